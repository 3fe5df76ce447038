//! The commands of the documents: each document's are run in its order, in a folder of its own, on samples that are
//! made here under the names that it uses. What it shows of their output is compared. Those that would take long are
//! read by the program, which then shows its settings.

mod common;
use common::surface::Surface;
use common::{Folder, Run};
use proxel::imaging::Image;
use proxel::imaging::io::{Depth, Format, ImageFile, encode, read_image};
use std::path::{Path, PathBuf};

/// Not solved here: the program says what its settings are.
const LONG: [&str; 1] = ["proxel simulate scenes/aa-figure5-pit.toml"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A document, and what leaves the samples that it speaks of.
type Document = (&'static str, fn(&Folder));

/// All documents with commands.
const DOCUMENTS: [Document; 10] = [
    ("README.md", |folder| {
        sphere(folder, "bunny.obj");
        folder.put("suit.obj", &Surface::patch(12).obj());
        folder.put("ears.toml", "[groups.foot]\nplane = { point = [0, 0.04, 0], normal = [0, -1, 0] }\n");
        folder.put("bad.txt", "-3\n");
    }),
    ("docs/deblur.md", |folder| {
        for name in ["photo.png", "scan.tif", "small.png", "grainy.png", "photons.tif", "scratched.png"] {
            image(folder, name, 40, |i, j| if (i / 10 + j / 13) % 2 == 0 { 0.25 } else { 0.75 } + 0.02 * wave(i, j));
        }
        image(folder, "good.png", 40, |i, j| if (i + 2 * j) % 17 == 0 { 0.0 } else { 1.0 });
        image(folder, "kernel.png", 5, |i, j| 1.0 / (1.0 + (i as f64 - 2.0).powi(2) + (j as f64 - 2.0).powi(2)));
    }),
    ("docs/deform.md", |_| {}),
    ("docs/geodesic.md", |folder| {
        folder.put("bunny.obj", &Surface::patch(100).obj());
        folder.put("patch.obj", &Surface::patch(30).obj());
        folder.run("convert patch.obj --out terrain.ply").is(0);
    }),
    ("docs/planarize.md", |folder| {
        folder.put("roof.obj", &Surface::quads(8).obj());
        folder.put("patch.obj", &Surface::patch(24).obj());
        folder.run("convert patch.obj --out scan.ply").is(0);
    }),
    ("docs/problem-files.md", |folder| {
        folder.beam(3);
        folder.run("convert rest.node --out body.mesh").is(0);
        let right = "[groups.right]\nindices = [12, 13, 14, 15]\ntranslate = [0.3, 0, 0]\n";
        folder.put("hands.toml", &format!("[groups.left]\nindices = [0, 1, 2, 3]\n\n{right}"));
        folder.put("scene.toml", &blocks("docs/simulate.md", &["toml"]).swap_remove(0).text);
    }),
    ("docs/start.md", |_| {}),
    ("docs/surfaces.md", |folder| sphere(folder, "stanford-bunny.obj")),
    ("docs/wavefront.md", |folder| {
        folder.run("wavefront --simulate 64,1,0 --out made").is(0);
        for name in ["reference", "captured"] {
            let file = read_image(&folder.0.join(format!("made/{name}.png"))).unwrap();
            for ending in ["png", "tif"] {
                write(&folder.0.join(format!("{name}.{ending}")), file.image.clone(), Depth::F32);
            }
        }
    }),
    ("docs/wire.md", |folder| {
        // Cells as long as two of the edges that are asked for, once they are cut in four.
        folder.put("torso.obj", &Surface::quads(8).moved(8.0 * 1.34, [0.0; 3]).obj());
        folder.put("scan.obj", &Surface::patch(24).moved(8.0 * 1.34, [0.0; 3]).obj());
    }),
];

/// A closed surface as long as the bunny, around where the pins of the documents are.
fn sphere(folder: &Folder, name: &str) {
    folder.put(name, &Surface::sphere(10).moved(0.075, [0.0, 0.11, 0.0]).obj());
}

fn wave(i: usize, j: usize) -> f64 {
    (1.7 * i as f64).sin() * (2.3 * j as f64).cos()
}

fn image(folder: &Folder, name: &str, side: usize, of: impl Fn(usize, usize) -> f64) {
    let plane = (0..side * side).map(|k| of(k / side, k % side)).collect();
    write(&folder.0.join(name), Image::new(side, side, vec![plane]).unwrap(), Depth::U16);
}

fn write(path: &Path, image: Image, depth: Depth) {
    let format = Format::from_path(path).unwrap();
    let depth = if matches!(format, Format::Png) { Depth::U16 } else { depth };
    std::fs::write(path, encode(&ImageFile::new(image, depth), format).unwrap().bytes).unwrap();
}

/// A block of code, the line it begins in, and the text before it.
struct Block {
    line: usize,
    text: String,
    before: String,
}

fn blocks(document: &str, languages: &[&str]) -> Vec<Block> {
    let text = std::fs::read_to_string(root().join(document)).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    let mut at = 0;
    while at < lines.len() {
        let Some(language) = lines[at].strip_prefix("```") else {
            at += 1;
            continue;
        };
        let end = (at + 1..lines.len()).find(|k| lines[*k] == "```").unwrap();
        if languages.contains(&language) {
            let text = lines[at + 1..end].iter().map(|l| format!("{l}\n")).collect();
            found.push(Block { line: at + 2, text, before: lines[at.saturating_sub(3)..at].join(" ") });
        }
        at = end + 1;
    }
    found
}

/// A command, and the lines that a document shows of what it prints.
struct Shown {
    line: usize,
    command: String,
    output: Vec<String>,
}

/// Commands of a block: in `console` they begin with `$ ` and output follows, in `sh` there are only commands. A line
/// that ends with a backslash goes on in the next.
fn commands(block: &Block, console: bool) -> Vec<Shown> {
    let mut found: Vec<Shown> = Vec::new();
    let mut goes_on = false;
    for (k, line) in block.text.lines().enumerate() {
        let begins = if console { line.strip_prefix("$ ") } else { Some(line).filter(|l| !l.is_empty()) };
        let part = if goes_on { Some(line.trim()) } else { begins };
        match (part, found.last_mut()) {
            (Some(part), Some(last)) if goes_on => last.command += &format!(" {}", part.trim_end_matches('\\').trim()),
            (Some(part), _) => {
                let command = part.trim_end_matches('\\').trim().to_owned();
                found.push(Shown { line: block.line + k, command, output: Vec::new() });
            }
            (None, Some(last)) if !line.is_empty() => last.output.push(line.to_owned()),
            _ => {}
        }
        goes_on = part.is_some_and(|p| p.ends_with('\\'));
    }
    found.iter_mut().for_each(|c| c.command = c.command.split(" #").next().unwrap_or_default().trim().to_owned());
    found
}

fn commands_of(document: &str) -> Vec<Shown> {
    let of = |language: &str| -> Vec<Shown> {
        let blocks = blocks(document, &[language]);
        blocks.iter().flat_map(|b| commands(b, language == "console")).collect()
    };
    let mut all = of("console");
    all.extend(of("sh"));
    all.sort_by_key(|c| c.line);
    all
}

/// What a line is apart from what differs from machine to machine: of lines about a solution the numbers.
fn skeleton(line: &str) -> String {
    if !["converged", "energy", "farthest", "phi"].iter().any(|word| line.starts_with(word)) {
        return line.to_owned();
    }
    let digit = |c: char| c.is_ascii_digit() || c == '.' || c == '-' || c == '+';
    let word = |w: &str| if w.starts_with(digit) { "#".to_owned() } else { w.to_owned() };
    line.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// The shown lines come in the output in their order; `...` stands for any, and at the end of a line for its rest.
fn is_as_shown(shown: &Shown, run: &Run) -> Result<(), String> {
    let printed = format!("{}{}", run.out, run.err);
    let mut left = printed.lines();
    for line in shown.output.iter().filter(|l| l.trim() != "...") {
        let (begin, is_whole) = line.strip_suffix(" ...").map_or((&line[..], true), |begin| (begin, false));
        let same = |l: &str| if is_whole { l == skeleton(begin) } else { l.starts_with(&skeleton(begin)) };
        if !left.any(|l| same(&skeleton(l))) {
            return Err(format!("`{line}` is not where it is shown in\n{printed}"));
        }
    }
    Ok(())
}

/// The file that a block of TOML is, by its first line or the text before it.
fn named(block: &Block) -> Option<String> {
    let first = block.text.lines().next()?.strip_prefix("# ").filter(|n| n.ends_with(".toml"));
    let before = || block.before.split('`').find(|n| n.ends_with(".toml") && !n.contains([' ', '/']));
    first.or_else(before).map(str::to_owned)
}

/// Runs the commands of a document; how many there were.
fn try_document(document: &str, prepare: fn(&Folder)) -> usize {
    let folder = Folder::new(&document.replace(['/', '.'], "-"));
    prepare(&folder);
    for block in blocks(document, &["toml"]) {
        if let Some(name) = named(&block) {
            folder.put(&name, &block.text);
        }
    }
    let shown: Vec<Shown> = commands_of(document).into_iter().filter(|c| c.command.starts_with("proxel ")).collect();
    for command in &shown {
        let place = format!("{document}:{}: {}", command.line, command.command);
        let words =
            command.command.trim_start_matches("proxel ").replace("scenes/", &format!("{}/scenes/", root().display()));
        if LONG.iter().any(|long| command.command.starts_with(long)) {
            let run = folder.run(&format!("{words} --show-settings"));
            assert_eq!(run.status, Some(0), "{place}: {run:?}");
            continue;
        }
        let run = folder.run(&words);
        // A refusal that is shown is what is to come.
        let expected = if command.output.iter().any(|l| l.starts_with("error: ")) { 2 } else { 0 };
        assert_eq!(run.status, Some(expected), "{place}: {run:?}");
        is_as_shown(command, &run).unwrap_or_else(|e| panic!("{place}: {e}"));
        let mut words = words.split_whitespace();
        while let Some(word) = words.next() {
            if expected == 0 && ["--out", "--report", "--preview", "--preview-3d", "--dump", "--trace"].contains(&word)
            {
                let file = words.next().unwrap_or_default();
                assert!(folder.has(file), "{place}: it has left no {file}");
            }
        }
    }
    shown.len()
}

macro_rules! documents {
    ($($name:ident = $index:literal, $commands:literal;)*) => {$(
        #[test]
        fn $name() {
            let (document, prepare) = DOCUMENTS[$index];
            assert_eq!(try_document(document, prepare), $commands, "{document}");
        }
    )*};
}

documents! {
    readme = 0, 10;
    deblur = 1, 6;
    deform = 2, 2;
    geodesic = 3, 2;
    planarize = 4, 1;
    problem_files = 5, 5;
    start = 6, 4;
    surfaces = 7, 1;
    wavefront = 8, 3;
    wire = 9, 1;
}

#[test]
fn no_command_is_left_out() {
    let mut pages: Vec<String> =
        ["README.md", "python/README.md", "CONTRIBUTING.md", "ARCHITECTURE.md"].map(str::to_owned).into();
    for entry in std::fs::read_dir(root().join("docs")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        pages.extend(name.ends_with(".md").then(|| format!("docs/{name}")));
    }
    let chores = std::fs::read_to_string(root().join("xtask/src/main.rs")).unwrap();
    for page in pages {
        let tried = DOCUMENTS.iter().any(|(document, _)| *document == page);
        for command in commands_of(&page) {
            let place = format!("{page}:{}: {}", command.line, command.command);
            let words: Vec<&str> = command.command.split_whitespace().collect();
            match words[..] {
                ["proxel", ..] => assert!(tried, "{place}: its document is not in DOCUMENTS"),
                ["cargo", "xtask", chore, ..] => assert!(chores.contains(&format!("\"{chore}\" =>")), "{place}"),
                ["cargo", "run", "--release", "-p", "proxel-cli", "--", "demo"] => {}
                ["cargo", "install", "--path", folder] => assert!(root().join(folder).join("Cargo.toml").exists()),
                ["pip", "install", "dist/proxel-*.whl"] => {}
                _ => panic!("{place}: nothing tries this command"),
            }
        }
        for block in blocks(&page, &["text", ""]) {
            let hidden = block.text.lines().any(|l| l.starts_with("proxel ") || l.starts_with("$ "));
            assert!(!hidden, "{page}:{}: commands are in blocks of sh or console, where they are tried", block.line);
        }
    }
}

#[test]
fn what_is_wrong_in_a_document_is_found() {
    let text = "$ proxel demo \\\n    --out here    # a picture\nwrote here\n\n$ proxel info x\n";
    let found = commands(&Block { line: 7, text: text.to_owned(), before: String::new() }, true);
    let shown: Vec<(usize, &str, usize)> = found.iter().map(|c| (c.line, &c.command[..], c.output.len())).collect();
    assert_eq!(shown, [(7, "proxel demo --out here", 1), (11, "proxel info x", 0)]);
    let shown = |lines: &[&str]| {
        let output = lines.iter().map(|l| (*l).to_owned()).collect();
        let run = Run {
            status: Some(0),
            out: "converged after 3 iterations\nwrote a.png\nwrote b.png\n".into(),
            err: String::new(),
        };
        is_as_shown(&Shown { line: 1, command: String::new(), output }, &run)
    };
    assert_eq!(shown(&["converged after 17 iterations", "...", "wrote b.png"]), Ok(()));
    assert_eq!(shown(&["converged after ...", "wrote a.png"]), Ok(()));
    for wrong in [
        &["wrote c.png"][..],
        &["wrote b.png", "wrote a.png"],
        &["stopped after 3 iterations"],
        &["converged before ..."],
    ] {
        assert!(shown(wrong).is_err(), "{wrong:?}");
    }
    let folder = Folder::new("documents-wrong");
    assert_eq!(folder.run("unwrap a.obj --out b.obj --no-such-option --show-settings").status, Some(2));
}
