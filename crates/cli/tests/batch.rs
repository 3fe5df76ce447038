//! `proxel batch unwrap`: one bad mesh harms none, nothing is done twice, and what was done is known.

mod common;

use std::time::{Duration, Instant};

use common::surface::Surface;
use common::{Folder, Run};
use serde_json::Value;

/// The lines of a file of results.
fn lines(folder: &Folder, file: &str) -> Vec<Value> {
    folder.read(file).lines().map(|l| serde_json::from_str(l).unwrap()).collect()
}

/// (output, status), sorted.
fn ends(lines: &[Value]) -> Vec<(String, String)> {
    let text = |v: &Value, key: &str| v[key].as_str().unwrap().to_owned();
    let mut ends: Vec<_> = lines.iter().map(|l| (text(l, "out"), text(l, "status"))).collect();
    ends.sort();
    ends
}

#[track_caller]
fn assert_ends(lines: &[Value], expected: &[(&str, &str)]) {
    let expected: Vec<_> = expected.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    assert_eq!(ends(lines), expected, "{lines:#?}");
}

fn line<'a>(lines: &'a [Value], out: &str) -> &'a Value {
    lines.iter().rfind(|l| l["out"] == out).unwrap()
}

/// A folder `in` with three good meshes, one of them deeper, and what is no mesh.
fn good(name: &str) -> Folder {
    let folder = Folder::new(name);
    std::fs::create_dir_all(folder.0.join("in/deep")).unwrap();
    folder.put("in/a.obj", &Surface::patch(4).obj());
    folder.put("in/deep/b.obj", &Surface::patch(5).obj());
    let off = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n3 0 1 2\n3 0 2 3\n";
    folder.put("in/c.off", off);
    folder.put("in/notes.txt", "no mesh");
    folder.put("in/.hidden.obj", "no mesh");
    folder
}

#[test]
fn one_bad_mesh_harms_none() {
    let folder = good("batch-bad");
    let mut nan = Surface::patch(4);
    nan.points[7][1] = f64::NAN;
    folder.put("in/nan.obj", &nan.obj());
    folder.put("in/no.ply", "ply\n");
    let run = folder.run("batch unwrap in --out uv --jobs 2 --no-pack");
    run.is(1);
    assert_eq!(
        run.out,
        format!("5 meshes: 3 converged, 2 refused; see {}\n", folder.0.join("uv/results.jsonl").display())
    );
    let refused: Vec<&str> = run.err.lines().collect();
    assert_eq!(refused.len(), 2, "{run:?}");
    assert!(refused.iter().any(|l| l.starts_with("refused: nan.obj: ") && l.contains("vertex 7")), "{run:?}");

    let lines = lines(&folder, "uv/results.jsonl");
    let expected = [
        ("a.obj", "converged"),
        ("c.obj", "converged"),
        ("deep/b.obj", "converged"),
        ("nan.obj", "refused"),
        ("no.ply", "refused"),
    ];
    assert_ends(&lines, &expected);
    let bad = line(&lines, "nan.obj");
    assert_eq!((&bad["exit_code"], &bad["written"], &bad["report"]), (&2.into(), &false.into(), &Value::Null));
    assert!(!folder.has("uv/nan.obj"));
    let b = line(&lines, "deep/b.obj");
    assert_eq!((&b["flips"], &b["overlaps"], &b["charts"]), (&0.into(), &0.into(), &1.into()));
    assert_eq!(b["options"], serde_json::json!(["--no-pack"]));
    assert_eq!(b["mesh"], "deep/b.obj");
    assert!(b["peak_bytes"].as_u64().unwrap() > 1 << 20);
    assert!(b["seconds"].as_f64().unwrap() > 0.0);
    let report: Value = serde_json::from_str(&folder.read("uv/reports/deep/b.obj.json")).unwrap();
    assert_eq!(b["report"], "reports/deep/b.obj.json");
    assert_eq!((&report["energy"], &report["reason"]), (&b["energy"], &b["reason"]));

    // Each map is what `unwrap` makes of the mesh alone.
    folder.run("unwrap in/deep/b.obj --no-pack --out alone.obj").is(0);
    assert_eq!(folder.read("uv/deep/b.obj"), folder.read("alone.obj"));
}

#[test]
fn the_time_limit_stops_with_a_result() {
    let folder = good("batch-time");
    let command = "batch unwrap in --out uv --time-limit-per-mesh 1e-7";
    folder.run(command).is(3);
    let first = lines(&folder, "uv/results.jsonl");
    assert_ends(&first, &[("a.obj", "stopped"), ("c.obj", "stopped"), ("deep/b.obj", "stopped")]);
    assert!(first.iter().all(|l| l["exit_code"] == 3 && l["written"] == true), "{first:#?}");
    assert!(folder.has("uv/a.obj") && folder.has("uv/deep/b.obj"));
    // They have ended: no more time changes that, unless they are to be tried again.
    folder.run("batch unwrap in --out uv").is(3);
    assert_eq!(lines(&folder, "uv/results.jsonl").len(), 3);
    folder.run("batch unwrap in --out uv --retry-failed").is(0);
    assert_eq!(lines(&folder, "uv/results.jsonl").len(), 6);
}

#[cfg(target_os = "linux")]
#[test]
fn the_memory_limit_ends_one_mesh_only() {
    let folder = good("batch-memory");
    folder.put("in/large.obj", &Surface::patch(300).obj());
    folder.run("batch unwrap in --out uv --memory-limit 100M --max-iters 2 --threads 1").is(1);
    let lines = lines(&folder, "uv/results.jsonl");
    let large = line(&lines, "large.obj");
    assert_eq!((&large["status"], &large["signal"]), (&"memory".into(), &6.into()), "{large}");
    let reason = large["reason"].as_str().unwrap();
    assert!(reason.contains("memory allocation of") && reason.contains("--memory-limit"), "{reason}");
    assert!(!folder.has("uv/large.obj"));
    assert_eq!(lines.len(), 4);
    for out in ["a.obj", "c.obj", "deep/b.obj"] {
        assert_eq!(line(&lines, out)["written"], true);
    }
}

#[test]
fn what_is_done_is_not_done_again() {
    let folder = good("batch-resume");
    let command = "batch unwrap in --out uv --no-pack";
    folder.run(command).is(0);
    let stamp = |name: &str| std::fs::metadata(folder.0.join(name)).unwrap().modified().unwrap();
    let (before, a) = (folder.read("uv/results.jsonl"), stamp("uv/a.obj"));
    let again = folder.run(command);
    again.is(0);
    assert!(again.out.starts_with("3 meshes: 3 converged, 3 of them in an earlier run; see "), "{again:?}");
    assert_eq!(folder.read("uv/results.jsonl"), before);
    assert_eq!(stamp("uv/a.obj"), a);

    let count = || folder.read("uv/results.jsonl").lines().count();
    folder.put("in/a.obj", &Surface::patch(3).obj());
    folder.run(command).is(0);
    assert_eq!(count(), 4, "one mesh has another content");
    std::fs::remove_file(folder.0.join("uv/c.obj")).unwrap();
    folder.run(&format!("{command} --resume")).is(0);
    assert_eq!(count(), 5, "one map was not there any more");
    assert!(folder.has("uv/c.obj"));
    folder.run(&format!("{command} --threads 2 --jobs 1 --time-limit-per-mesh 600")).is(0);
    assert_eq!(count(), 5, "limits and threads change no map");
    folder.run(&format!("{command} --tol 1e-6")).is(0);
    assert_eq!(count(), 8, "other options make other maps");
    folder.run(&format!("{command} --fresh")).is(0);
    assert_eq!(count(), 3, "everything anew");
}

#[test]
fn a_torn_line_is_done_again() {
    let folder = good("batch-torn");
    folder.run("batch unwrap in --out uv").is(0);
    let text = folder.read("uv/results.jsonl");
    folder.put("uv/results.jsonl", &text[..text.len() - 20]);
    folder.run("batch unwrap in --out uv").is(0);
    let all = lines(&folder, "uv/results.jsonl");
    assert_ends(&all, &[("a.obj", "converged"), ("c.obj", "converged"), ("deep/b.obj", "converged")]);
    let broken = folder.read("uv/results.jsonl").replacen("\"mesh\"", "\"mush\"", 1);
    folder.put("uv/results.jsonl", &broken);
    folder.run("batch unwrap in --out uv").is_refused(&["results.jsonl", "line 1", "--fresh"]);
}

#[test]
fn failures_alone_are_tried_again() {
    let folder = good("batch-retry");
    let list = "{\"mesh\": \"in/a.obj\"}\nin/missing.obj\n";
    folder.put("list.jsonl", list);
    folder.run("batch unwrap list.jsonl --out uv").is(1);
    let first = lines(&folder, "uv/results.jsonl");
    assert_ends(&first, &[("in/a.obj", "converged"), ("in/missing.obj", "refused")]);
    let reason = line(&first, "in/missing.obj")["reason"].as_str().unwrap();
    assert!(reason.contains("missing.obj") && reason.contains("line 2"), "{reason}");
    folder.run("batch unwrap list.jsonl --out uv").is(1);
    assert_eq!(lines(&folder, "uv/results.jsonl").len(), 2, "a failure stands");
    folder.run("batch unwrap list.jsonl --out uv --retry-failed").is(1);
    assert_eq!(lines(&folder, "uv/results.jsonl").len(), 3);
    // Another content is another mesh, failure or not.
    folder.put("in/missing.obj", &Surface::patch(3).obj());
    let run = folder.run("batch unwrap list.jsonl --out uv");
    run.is(0);
    assert!(run.out.contains("2 meshes: 2 converged, 1 of them in an earlier run"), "{run:?}");
    assert_eq!(lines(&folder, "uv/results.jsonl").len(), 4);
}

#[test]
fn a_manifest_has_options_and_outputs_of_its_own() {
    let folder = good("batch-manifest");
    std::fs::create_dir(folder.0.join("lists")).unwrap();
    folder.put("lists/pins.txt", "0 5 5\n");
    folder.put("lists/weights.txt", &"1\n".repeat(32));
    folder.put(
        "lists/some.jsonl",
        "# all kinds\n../in/a.obj\n\
         {\"mesh\": \"../in/a.obj\", \"out\": \"two/pinned.obj\", \"args\": [\"--pin\", \"pins.txt\", \"--method\", \"cm\"]}\n\
         {\"mesh\": \"../in/a.obj\", \"out\": \"w.ply\", \"args\": [\"--weights\", \"weights.txt\"]}\n",
    );
    folder.run("batch unwrap lists/some.jsonl --out uv --method wrapd+cm --jobs 3").is(0);
    let all = lines(&folder, "uv/results.jsonl");
    assert_ends(&all, &[("a.obj", "converged"), ("two/pinned.obj", "converged"), ("w.ply", "converged")]);
    let method = |report: &str| serde_json::from_str::<Value>(&folder.read(report)).unwrap()["method"].clone();
    assert_eq!(method("uv/reports/a.obj.json"), "wrapd+cm");
    assert_eq!(method("uv/reports/two/pinned.obj.json"), "cm");
    // The content of a file that an option names counts as the option does.
    folder.put("lists/pins.txt", "0 5 6\n");
    folder.run("batch unwrap lists/some.jsonl --out uv --method wrapd+cm").is(0);
    let all = lines(&folder, "uv/results.jsonl");
    assert_eq!(all.len(), 4);
    assert_eq!(all[3]["out"], "two/pinned.obj");
}

#[test]
fn shards_part_the_list() {
    let folder = good("batch-shards");
    for k in 0..4 {
        folder.put(&format!("in/s{k}.obj"), &Surface::patch(3).obj());
    }
    let mut seen = Vec::new();
    for k in 0..3 {
        folder.run(&format!("batch unwrap in --out uv --shard {k}/3")).is(0);
        seen.push(lines(&folder, &format!("uv/results-{k}-of-3.jsonl")));
    }
    assert_eq!(seen.iter().map(Vec::len).collect::<Vec<_>>(), [3, 2, 2]);
    let mut outs: Vec<String> = seen.iter().flatten().map(|l| l["out"].as_str().unwrap().to_owned()).collect();
    outs.sort();
    assert_eq!(outs, ["a.obj", "c.obj", "deep/b.obj", "s0.obj", "s1.obj", "s2.obj", "s3.obj"]);
    assert!(!folder.has("uv/results.jsonl"));
    let more = folder.run("batch unwrap in --out uv --shard 8/9");
    more.is(0);
    assert!(more.out.starts_with("0 meshes: "), "{more:?}");
}

/// Refused as a whole: exit status 2, one line, and no folder for outputs.
#[track_caller]
fn refuses(folder: &Folder, words: &str, parts: &[&str]) {
    folder.run(words).is_refused(parts);
    assert!(!folder.has("uv"), "{words}");
}

#[test]
fn what_is_refused_as_a_whole() {
    let folder = good("batch-refused");
    let with = |options: &str| format!("batch unwrap in --out uv {options}");
    refuses(&folder, "batch unwrap none --out uv", &["none", "cannot be read", "check the path"]);
    refuses(&folder, "batch unwrap in/a.obj --out uv", &["a.obj", "it is a mesh", "proxel unwrap"]);
    refuses(&folder, "batch unwrap in", &["--out"]);
    refuses(&folder, "batch unwrap in --out in", &["a.obj", "write over this mesh", "another folder"]);
    refuses(&folder, &with("--report r.json"), &["--report", "many meshes", "OUT/reports"]);
    refuses(&folder, &with("--trace t.csv"), &["--trace", "many meshes", "manifest"]);
    refuses(&folder, &with("--shard 3/3"), &["--shard", "0 <= i < n"]);
    refuses(&folder, &with("--memory-limit lots"), &["--memory-limit", "4G"]);
    refuses(&folder, &with("--jobs 0"), &["--jobs"]);
    refuses(&folder, &with("--tol -1"), &["tol is -1"]);
    refuses(&folder, &with("--metod cm"), &["--metod", "--method"]);
    refuses(&folder, &with("--fresh --retry-failed"), &["--fresh", "--retry-failed"]);
    folder.put("uv", "a file");
    folder.run(&with("")).is_refused(&["uv", "cannot be made", "another --out"]);
    std::fs::remove_file(folder.0.join("uv")).unwrap();

    folder.put("in/a.stl", "");
    refuses(&folder, &with(""), &["a.obj", "a.stl", "would both write", "rename one"]);
    folder.put("list", "in/a.obj\nin/deep/../a.obj\n./in/a.obj\n");
    refuses(&folder, "batch unwrap list --out uv", &["line 1", "line 3", "would both write"]);
    folder.put("list", "in/a.obj\n{\"mesh\": \"in/a.obj\", \"out\": \"x.obj\", \"args\": [\"--report\", \"r\"]}\n");
    refuses(&folder, "batch unwrap list --out uv", &["list: line 2", "--report"]);
    std::fs::create_dir(folder.0.join("empty")).unwrap();
    refuses(&folder, "batch unwrap empty --out uv", &["empty", "no meshes"]);
}

#[test]
fn settings_are_shown_as_for_one_mesh() {
    let folder = Folder::new("batch-settings");
    let one = folder.run("unwrap --show-settings --method cm");
    let many = folder.run("batch unwrap --show-settings --method cm");
    many.is(0);
    assert_eq!(one.out, many.out);
    assert_eq!(folder.names(), Vec::<String>::new());
}

#[test]
fn outputs_within_the_folder_of_meshes_are_no_meshes() {
    let folder = good("batch-inside");
    for _ in 0..2 {
        folder.run("batch unwrap in --out in/uv").is(0);
        assert_eq!(lines(&folder, "in/uv/results.jsonl").len(), 3);
    }
}

#[cfg(unix)]
#[test]
fn links_and_odd_names() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new("batch-odd");
    let dir = folder.0.join("in");
    std::fs::create_dir(&dir).unwrap();
    let text = Surface::patch(3).obj();
    for name in [&b"a\xff.obj"[..], b"-o.obj", b"line\nbreak.obj", "\u{e9} \u{1f9ca}.obj".as_bytes()] {
        std::fs::write(dir.join(std::ffi::OsStr::from_bytes(name)), &text).unwrap();
    }
    std::os::unix::fs::symlink(&dir, dir.join("again")).unwrap();
    // This one has no end.
    std::os::unix::fs::symlink("/dev/zero", dir.join("zero.obj")).unwrap();
    let run = folder.run("batch unwrap in --out uv");
    run.is(1);
    assert_eq!(run.err.lines().count(), 1, "{run:?}");
    let all = lines(&folder, "uv/results.jsonl");
    assert_eq!(all.len(), 5, "{all:#?}");
    for out in [r"a\xff.obj", "-o.obj", "line\nbreak.obj", "\u{e9} \u{1f9ca}.obj"] {
        assert_eq!(line(&all, out)["status"], "converged", "{out}");
    }
    assert!(dir.join("../uv").join(std::ffi::OsStr::from_bytes(b"a\xff.obj")).exists());
    assert_eq!(line(&all, "zero.obj")["status"], "refused");
    assert!(line(&all, "zero.obj")["reason"].as_str().unwrap().contains("it is no file"));
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_batch_with_the_best_results_and_the_next_run_goes_on() {
    use nix::sys::signal::{Signal, kill};
    let folder = good("batch-cancel");
    // Endless: it never reaches this tolerance.
    folder.put("in/z.obj", &Surface::patch(60).obj());
    let words = "batch unwrap in --out uv --jobs 1 --method admm-pd --tol 1e-300 --max-iters 100000000";
    folder.put("list.jsonl", "in/z.obj\nin/a.obj\n");
    let child = folder
        .command(&words.replace(" in ", " list.jsonl "))
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    // The report folder of the mesh is made just before its process; then there is a moment to get to work.
    let patience = Instant::now();
    while !folder.has("uv/reports/in") && patience.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_secs(3));
    kill(nix::unistd::Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap();
    let run = Run::of(child.wait_with_output().unwrap());
    run.is(130);
    assert!(run.out.contains("2 meshes: 1 cancelled, 1 not begun"), "{run:?}");
    let all = lines(&folder, "uv/results.jsonl");
    assert_ends(&all, &[("in/z.obj", "cancelled")]);
    assert_eq!((&all[0]["exit_code"], &all[0]["written"]), (&130.into(), &true.into()), "{all:#?}");
    assert!(folder.has("uv/in/z.obj"));
    // What was cancelled is begun again.
    folder.run("batch unwrap list.jsonl --out uv --method admm-pd --tol 1e-300 --max-iters 2").is(3);
    assert_eq!(lines(&folder, "uv/results.jsonl").len(), 3);
}

#[test]
fn two_batches_do_not_write_the_same_results() {
    let folder = good("batch-lock");
    std::fs::create_dir(folder.0.join("uv")).unwrap();
    let held = std::fs::File::create(folder.0.join("uv/results.jsonl")).unwrap();
    held.try_lock().unwrap();
    folder.run("batch unwrap in --out uv").is_refused(&["results.jsonl", "in use", "another --out"]);
    drop(held);
    folder.run("batch unwrap in --out uv --quiet").is(0);
}
