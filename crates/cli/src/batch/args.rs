//! The arguments of `proxel batch unwrap`: its own, and those of `proxel unwrap`, which it passes on.

use std::path::PathBuf;

use clap::{ArgMatches, Args, Command, FromArgMatches, Subcommand};

use super::options::{Options, definition};
use crate::refusal::Refusal;
use crate::unwrap::UnwrapArgs;

/// What can be done to many meshes.
#[derive(Subcommand)]
pub enum BatchCommand {
    /// Map many surfaces to the plane: `proxel unwrap` on each, in a process of its own.
    Unwrap(Box<BatchArgs>),
}

const HELP: &str = "\
Examples:
  proxel batch unwrap scans --out uv --jobs 8 --time-limit-per-mesh 60 --memory-limit 4G
  proxel batch unwrap list.jsonl --out uv --retry-failed
  proxel batch unwrap scans --out uv --shard $SLURM_ARRAY_TASK_ID/16       0/16 to 15/16

A folder is searched with all folders in it for meshes, names that begin with a dot left out; outputs keep their
places in it. A manifest has a line for each mesh, relative to its folder: a path, or
{\"mesh\": \"a.obj\", \"out\": \"x.obj\", \"args\": [\"--method\", \"cm\"]}; `#` begins a comment line. Outputs have the
extension of the input where that carries texture coordinates, else .obj.

OUT/results.jsonl (with --shard results-i-of-n.jsonl) gets a line as each mesh ends, and OUT/reports the report of
each. The same command again goes on where it was: meshes with the same content and the same options that have
ended are not run again. Of several lines for one output the last counts. Limits, threads and jobs may change.
The status of a mesh is converged, stopped (the best result is written), failed, refused (bad input), timeout
(killed), memory, crashed, or cancelled (always run again).

Exit status: 0 all converged, 3 some were stopped, 1 some have no result, 2 bad usage, 130 cancelled.";

/// The options of a batch.
#[derive(Args)]
#[command(next_help_heading = "Batch")]
pub struct OwnArgs {
    /// Meshes at a time; one for each processor if not given. Each has its share of the processors as --threads.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub jobs: Option<u32>,
    /// The most memory that a mesh may take: bytes, or with K, M, G or T (powers of 1024).
    #[arg(long, value_name = "BYTES", value_parser = bytes)]
    pub memory_limit: Option<u64>,
    /// Go on where the last run ended: the default.
    #[arg(long, conflicts_with = "fresh")]
    pub resume: bool,
    /// Forget earlier results and run all meshes again.
    #[arg(long, conflicts_with = "retry_failed")]
    pub fresh: bool,
    /// Run those again that have not converged.
    #[arg(long)]
    pub retry_failed: bool,
    /// Every n-th mesh of the list, from the i-th on, 0 <= i < n: the part of one machine out of n.
    #[arg(long, value_name = "i/n", value_parser = shard)]
    pub shard: Option<Shard>,
}

/// Part `index` of `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    pub index: usize,
    pub count: usize,
}

/// The arguments of `proxel batch unwrap`.
pub struct BatchArgs {
    pub own: OwnArgs,
    /// The arguments of `unwrap` as they would be for one mesh.
    pub unwrap: UnwrapArgs,
    /// The options to pass on, or why they cannot be.
    pub options: Result<Options, Refusal>,
}

impl FromArgMatches for BatchArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Ok(BatchArgs {
            own: OwnArgs::from_arg_matches(matches)?,
            unwrap: UnwrapArgs::from_arg_matches(matches)?,
            options: Options::for_all(matches),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for BatchArgs {
    fn augment_args(command: Command) -> Command {
        let command = OwnArgs::augment_args(UnwrapArgs::augment_args(command).next_help_heading(None::<&str>));
        // What names one file cannot be said for all meshes; `Options::for_all` refuses it with the remedy.
        let hidden = definition()
            .get_arguments()
            .filter(|a| super::options::names_an_output(a))
            .map(|a| a.get_id().to_string())
            .collect::<Vec<_>>();
        let command = hidden.into_iter().fold(command, |c, id| c.mut_arg(id, |a| a.hide(true)));
        command
            .mut_arg("mesh", |a| a.value_name("DIR|MANIFEST").help("A folder with meshes, or a list of meshes"))
            .mut_arg("out", |a| {
                a.value_name("DIR")
                    .hide(false)
                    .help("The folder for maps, reports and results; made if it is not there")
            })
            .mut_arg("time_limit", |a| {
                a.long("time-limit-per-mesh").alias("time-limit").help(
                    "Stop a mesh after so many seconds with the best result so far; it is killed after twice \
                     the time and ten seconds more",
                )
            })
            .mut_arg("threads", |a| a.help("Threads of each mesh; the processors over --jobs if not given"))
            .after_help(HELP)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl BatchArgs {
    /// The folder or manifest, and the folder for outputs: clap asks for both unless settings are shown.
    pub fn source_and_out(&self) -> Result<(PathBuf, PathBuf), Refusal> {
        match (&self.unwrap.mesh, &self.unwrap.solve.out) {
            (Some(source), Some(out)) => Ok((source.clone(), out.clone())),
            _ => Err(Refusal::new("DIR|MANIFEST and --out are needed; see proxel batch unwrap --help")),
        }
    }
}

/// Less than this and not even the program starts.
const LEAST_MEMORY: u64 = 64 << 20;

/// `4G`, `512M`, `1073741824`.
fn bytes(text: &str) -> Result<u64, String> {
    let upper = text.to_ascii_uppercase();
    let plain = upper.strip_suffix("IB").or_else(|| upper.strip_suffix('B')).unwrap_or(&upper);
    let (digits, shift) = match plain.chars().last() {
        Some('K') => (&plain[..plain.len() - 1], 10),
        Some('M') => (&plain[..plain.len() - 1], 20),
        Some('G') => (&plain[..plain.len() - 1], 30),
        Some('T') => (&plain[..plain.len() - 1], 40),
        _ => (plain, 0),
    };
    let number: u64 = digits.parse().map_err(|_| "give bytes, such as 4G or 512M".to_owned())?;
    let bytes = number.checked_mul(1 << shift).ok_or("it is more than 64 bits can hold")?;
    if bytes < LEAST_MEMORY {
        return Err(format!("a process needs {LEAST_MEMORY} bytes at least; give 64M or more"));
    }
    Ok(bytes)
}

/// `3/16`.
fn shard(text: &str) -> Result<Shard, String> {
    let wrong = || "give i/n with 0 <= i < n, such as 0/16".to_owned();
    let (index, count) = text.split_once('/').ok_or_else(wrong)?;
    let (index, count): (usize, usize) = (index.parse().map_err(|_| wrong())?, count.parse().map_err(|_| wrong())?);
    if index < count { Ok(Shard { index, count }) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_memory() {
        for text in ["4G", "4g", "4GiB", "4096M", "4194304K", "4294967296", "4294967296B"] {
            assert_eq!(bytes(text), Ok(4 << 30), "{text}");
        }
        for text in ["", "G", "-1G", "1.5G", "99999999999999999999", "99999999T", "63M", "0", "4é"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn shards() {
        assert_eq!(shard("0/1"), Ok(Shard { index: 0, count: 1 }));
        assert_eq!(shard("15/16"), Ok(Shard { index: 15, count: 16 }));
        for text in ["16/16", "1", "/", "0/0", "-1/2", "1/2/3", "a/b"] {
            assert!(shard(text).is_err(), "{text}");
        }
    }
}
