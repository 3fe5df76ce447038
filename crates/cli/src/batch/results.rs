//! What has been done: `results.jsonl`, a line for each mesh as it ends.
//!
//! Lines are appended and flushed one by one, so that a kill loses nothing but the line being written; the next run
//! takes such a torn line away. Where an output has several lines the last counts.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::args::Shard;
use crate::refusal::Refusal;

/// How a mesh ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// The map is the best there is.
    Converged,
    /// By a limit; the map is the best so far.
    Stopped,
    /// By the solver.
    Failed,
    /// The input is no mesh that can be mapped.
    Refused,
    /// Killed, as it did not heed its time limit.
    Timeout,
    /// It wanted more memory than the limit.
    Memory,
    /// By a signal or a panic.
    Crashed,
    /// By Ctrl-C.
    Cancelled,
}

impl End {
    /// All, the best first.
    pub const ALL: [End; 8] = [
        End::Converged,
        End::Stopped,
        End::Failed,
        End::Refused,
        End::Timeout,
        End::Memory,
        End::Crashed,
        End::Cancelled,
    ];

    /// As in the file.
    pub fn as_str(self) -> &'static str {
        match self {
            End::Converged => "converged",
            End::Stopped => "stopped",
            End::Failed => "failed",
            End::Refused => "refused",
            End::Timeout => "timeout",
            End::Memory => "memory",
            End::Crashed => "crashed",
            End::Cancelled => "cancelled",
        }
    }
}

/// A line of the file. Null where nothing is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The mesh, as the list has it.
    pub mesh: String,
    /// Its map, in the folder for outputs.
    pub out: String,
    /// Whether this run wrote it.
    pub written: bool,
    pub status: End,
    /// Of the process.
    pub exit_code: Option<i32>,
    /// That ended the process.
    pub signal: Option<i32>,
    pub reason: String,
    /// Wall time of the process.
    pub seconds: f64,
    /// Largest resident memory.
    pub peak_bytes: Option<u64>,
    /// Of the map as written: 1 is an isometry.
    pub energy: Option<f64>,
    pub flips: Option<usize>,
    pub overlaps: Option<u64>,
    pub charts: Option<usize>,
    /// In the folder for outputs.
    pub report: Option<String>,
    /// Of the mesh file.
    pub input_sha256: Option<String>,
    /// Of the options, and of the files that they name.
    pub options_sha256: String,
    pub options: Vec<String>,
}

/// The file, open and locked.
pub struct Results {
    file: File,
    path: PathBuf,
}

impl Results {
    /// Opens the file of a shard and reads what is there, by output; an empty one if `fresh`.
    pub fn open(folder: &Path, shard: Option<Shard>, fresh: bool) -> Result<(Self, BTreeMap<String, Record>), Refusal> {
        let name = shard.map_or("results.jsonl".to_owned(), |s| format!("results-{}-of-{}.jsonl", s.index, s.count));
        let path = folder.join(name);
        let refuse = |what: &str, e: &dyn std::fmt::Display, remedy: &str| {
            Refusal::new(format!("{}: {what}: {e}; {remedy}", path.display()))
        };
        let check = "check the folder";
        let mut file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(&path)
            .map_err(|e| refuse("cannot be opened", &e, check))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(refuse("it is in use", &"another batch writes it", "wait for that, or use another --out"));
            }
            // Not every file system has locks.
            Err(TryLockError::Error(_)) => {}
        }
        let mut bytes = Vec::new();
        if fresh {
            file.set_len(0).map_err(|e| refuse("cannot be emptied", &e, check))?;
        } else {
            file.read_to_end(&mut bytes).map_err(|e| refuse("cannot be read", &e, check))?;
        }
        let (records, whole) = parse(&bytes).map_err(|(line, e)| {
            refuse(&format!("line {line} is no result"), &e, "correct the line, or use --fresh to begin anew")
        })?;
        if whole < bytes.len() {
            file.set_len(whole as u64).map_err(|e| refuse("cannot be cut after its last whole line", &e, check))?;
        }
        file.seek(SeekFrom::End(0)).map_err(|e| refuse("cannot be written", &e, check))?;
        Ok((Results { file, path }, records))
    }

    /// Adds a line, and sees that it is in the file.
    pub fn add(&mut self, record: &Record) -> Result<(), Refusal> {
        let refuse = |e: &dyn std::fmt::Display| {
            Refusal::new(format!("{}: cannot be written: {e}; make room, and run the same again", self.path.display()))
        };
        let mut line = serde_json::to_vec(record).map_err(|e| refuse(&e))?;
        line.push(b'\n');
        self.file.write_all(&line).map_err(|e| refuse(&e))?;
        self.file.flush().map_err(|e| refuse(&e))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// The records by output, and the length of the whole lines: what follows the last line break is torn.
fn parse(bytes: &[u8]) -> Result<(BTreeMap<String, Record>, usize), (usize, String)> {
    let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |k| k + 1);
    let mut records = BTreeMap::new();
    for (k, line) in bytes[..whole].split(|b| *b == b'\n').enumerate().filter(|(_, l)| !l.trim_ascii().is_empty()) {
        let record: Record = serde_json::from_slice(line).map_err(|e| (k + 1, e.to_string()))?;
        records.insert(record.out.clone(), record);
    }
    Ok((records, whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(out: &str, status: End) -> Record {
        Record {
            mesh: "m.obj".into(),
            out: out.into(),
            written: true,
            status,
            exit_code: Some(0),
            signal: None,
            reason: "line\nbreak".into(),
            seconds: 0.5,
            peak_bytes: None,
            energy: Some(1.25),
            flips: Some(0),
            overlaps: Some(0),
            charts: Some(1),
            report: None,
            input_sha256: None,
            options_sha256: String::new(),
            options: vec![],
        }
    }

    fn lines(records: &[Record]) -> String {
        records.iter().map(|r| serde_json::to_string(r).unwrap() + "\n").collect()
    }

    #[test]
    fn the_last_line_of_an_output_counts() {
        let all = [record("a", End::Failed), record("b", End::Stopped), record("a", End::Converged)];
        let text = lines(&all);
        let (records, whole) = parse(text.as_bytes()).unwrap();
        assert_eq!(whole, text.len());
        assert_eq!(records.len(), 2);
        assert_eq!(records["a"], all[2]);
    }

    #[test]
    fn a_torn_line_is_left_out_wherever_it_is_torn() {
        let kept = lines(&[record("a", End::Failed)]);
        let torn = lines(&[record("b", End::Failed)]);
        for cut in 0..torn.len() {
            let (records, whole) = parse(format!("{kept}{}", &torn[..cut]).as_bytes()).unwrap();
            assert_eq!((records.len(), whole), (1, kept.len()));
        }
        let e = parse(format!("{}\n{kept}", &torn[..9]).as_bytes()).unwrap_err();
        assert_eq!(e.0, 1, "not the last line: somebody edited the file");
    }

    #[test]
    fn statuses_are_named_as_in_the_file() {
        for end in End::ALL {
            assert_eq!(serde_json::to_string(&end).unwrap(), format!("\"{}\"", end.as_str()));
        }
    }
}
