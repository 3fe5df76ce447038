//! The options of `proxel unwrap` that a batch passes on to each mesh.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};

use super::hash::{Sha, hash_file};
use crate::args::one_line;
use crate::refusal::Refusal;
use crate::unwrap::UnwrapArgs;

/// What a batch says itself for each mesh.
const OWN: [&str; 5] = ["mesh", "out", "report", "quiet", "show_settings"];
/// Files that are read.
const INPUTS: [&str; 2] = ["pin", "weights"];
/// What changes how long a run takes and not what it makes: it may change between a run and its resumption.
const WITHOUT_EFFECT: [&str; 2] = ["threads", "time_limit"];

/// One option, as a single word for the child: `--method=cm`.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Passed {
    id: String,
    word: OsString,
    /// The file that it reads.
    reads: Option<PathBuf>,
}

/// Options for a mesh, in the order of the definition of `unwrap`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    passed: Vec<Passed>,
    /// Seconds.
    pub time_limit: Option<f64>,
    pub threads: Option<usize>,
}

/// `proxel unwrap` as clap knows it.
pub fn definition() -> Command {
    UnwrapArgs::augment_args(Command::new("unwrap"))
}

/// Whether an option names a file to be written: any path that is not known to be read.
pub fn names_an_output(arg: &Arg) -> bool {
    arg.get_value_parser().type_id() == clap::builder::ValueParser::path_buf().type_id()
        && arg.get_id() != "mesh"
        && !INPUTS.contains(&arg.get_id().as_str())
}

impl Options {
    /// Those on the command line, which hold for all meshes. Paths become absolute: children have other folders.
    pub fn for_all(matches: &ArgMatches) -> Result<Self, Refusal> {
        for arg in definition().get_arguments().filter(|a| a.get_id() != "out" && names_an_output(a)) {
            if given(matches, arg.get_id().as_str()) {
                let name = arg.get_long().unwrap_or_default();
                let what = format!(
                    "--{name} names one file for many meshes; reports are in OUT/reports, and `args` in a manifest \
                     can have --{name} for each mesh"
                );
                return Err(Refusal::new(what));
            }
        }
        let here = std::env::current_dir()
            .map_err(|e| Refusal::new(format!("the current folder cannot be told: {e}; change to another")))?;
        Ok(Options::collect(matches, &here))
    }

    /// Those of a manifest's line. `folder`, the manifest's, is where their paths begin.
    pub fn for_one(words: &[String], folder: &Path) -> Result<Self, String> {
        // The batch gives the mesh and the output; clap wants them to be there.
        let fixed = ["unwrap", "mesh.obj", "--out", "out.obj"].map(str::to_owned);
        let matches = definition()
            .try_get_matches_from(fixed.iter().chain(words))
            .map_err(|e| one_line(&e.to_string()).trim_start_matches("error: ").to_owned())?;
        if let Some(id) = OWN.iter().skip(2).find(|id| given(&matches, id)) {
            return Err(format!("`args` has --{}, which the batch itself says; leave it out", id.replace('_', "-")));
        }
        let args = UnwrapArgs::from_arg_matches(&matches).map_err(|e| one_line(&e.to_string()))?;
        args.settings().map_err(|e| e.to_string())?;
        Ok(Options::collect(&matches, folder))
    }

    fn collect(matches: &ArgMatches, folder: &Path) -> Self {
        let mut out = Options {
            time_limit: matches.get_one("time_limit").copied(),
            threads: matches.get_one("threads").copied(),
            ..Options::default()
        };
        for arg in definition().get_arguments() {
            let (id, Some(long)) = (arg.get_id().as_str(), arg.get_long()) else { continue };
            if OWN.contains(&id) || WITHOUT_EFFECT.contains(&id) || !given(matches, id) {
                continue;
            }
            if matches!(arg.get_action(), ArgAction::SetTrue) {
                out.passed.push(Passed { id: id.to_owned(), word: format!("--{long}").into(), reads: None });
                continue;
            }
            for value in matches.get_raw(id).into_iter().flatten() {
                let reads_file = INPUTS.contains(&id) || id == "seams" && value != "auto" && value != "vt";
                let is_path = reads_file || names_an_output(arg);
                let value = if is_path { folder.join(value).into_os_string() } else { value.to_owned() };
                let mut word = OsString::from(format!("--{long}="));
                word.push(&value);
                out.passed.push(Passed { id: id.to_owned(), word, reads: reads_file.then(|| value.into()) });
            }
        }
        out
    }

    /// These, and `other` in their place where it has the same.
    pub fn overridden_by(&self, other: &Options) -> Options {
        let kept = self.passed.iter().filter(|p| other.passed.iter().all(|o| o.id != p.id));
        Options {
            passed: kept.chain(&other.passed).cloned().collect(),
            time_limit: other.time_limit.or(self.time_limit),
            threads: other.threads.or(self.threads),
        }
    }

    /// The words for a child.
    pub fn words(&self) -> impl Iterator<Item = &OsStr> {
        self.passed.iter().map(|p| p.word.as_os_str())
    }

    /// A hash of all that changes the result: the options, and the content of the files that they name.
    pub fn hash(&self) -> String {
        let mut passed: Vec<&Passed> = self.passed.iter().collect();
        passed.sort_by(|a, b| a.id.cmp(&b.id));
        let mut sha = Sha::default();
        for p in passed {
            match &p.reads {
                None => sha.part(p.word.as_encoded_bytes()),
                Some(file) => {
                    sha.part(p.id.as_bytes());
                    // A file that cannot be read is the child's to complain about.
                    sha.part(hash_file(file).unwrap_or_default().as_bytes());
                }
            }
        }
        sha.hex()
    }
}

fn given(matches: &ArgMatches, id: &str) -> bool {
    matches.value_source(id) == Some(ValueSource::CommandLine)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(words: &[&str]) -> Result<Options, String> {
        Options::for_one(&words.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>(), Path::new("/base"))
    }

    fn words(options: &Options) -> Vec<&str> {
        options.words().map(|w| w.to_str().unwrap()).collect()
    }

    #[test]
    fn options_are_passed_on_as_they_were_given() {
        let options =
            one(&["--seams", "s.txt", "--no-pack", "--pin=p.txt", "--tol", "1e-6", "--threads", "3"]).unwrap();
        let given = words(&options);
        for word in ["--seams=/base/s.txt", "--no-pack", "--pin=/base/p.txt", "--tol=1e-6"] {
            assert!(given.contains(&word), "{word} is not in {given:?}");
        }
        assert_eq!(given.len(), 4, "{given:?}");
        assert_eq!((options.threads, options.time_limit), (Some(3), None));
        assert_eq!(words(&one(&["--seams", "vt"]).unwrap()), ["--seams=vt"]);
        assert_eq!(words(&one(&["--trace", "t.csv"]).unwrap()), ["--trace=/base/t.csv"]);
    }

    #[test]
    fn a_line_overrides_the_command() {
        let all = one(&["--method", "wrapd", "--tol", "1e-6", "--time-limit", "9"]).unwrap();
        let line = one(&["--method", "cm", "--threads", "2"]).unwrap();
        let both = all.overridden_by(&line);
        assert_eq!(words(&both), ["--tol=1e-6", "--method=cm"]);
        assert_eq!((both.threads, both.time_limit), (Some(2), Some(9.0)));
        assert_eq!(both.hash(), one(&["--method", "cm", "--tol", "1e-6"]).unwrap().hash(), "limits do not count");
        assert_ne!(both.hash(), all.hash());
    }

    #[test]
    fn what_a_line_may_not_say() {
        for (words, part) in [
            (&["--report", "r.json"][..], "--report"),
            (&["--out", "b.obj"], "--out"),
            (&["--quiet"], "--quiet"),
            (&["other.obj"], "other.obj"),
            (&["--metod", "cm"], "--metod"),
            (&["--tol", "-1"], "tol is -1"),
        ] {
            let e = one(words).unwrap_err();
            assert!(e.contains(part) && !e.contains('\n'), "{e}");
        }
    }
}
