//! Keeps as many children busy as it may, and writes down how each ended.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};

use super::args::BatchArgs;
use super::child::{Asked, LIMITS_MEMORY};
use super::list::{Item, items, of_shard};
use super::mesh::Run;
use super::results::{End, Record, Results};
use super::tally::Tally;
use crate::interrupt::CANCELLED;
use crate::refusal::Refusal;

/// The whole batch.
pub fn run(args: BatchArgs) -> Result<u8, Refusal> {
    args.unwrap.settings()?;
    if args.unwrap.solve.run.show_settings {
        return crate::unwrap::run(&args.unwrap);
    }
    if args.own.memory_limit.is_some() && !LIMITS_MEMORY {
        return Err(Refusal::new("--memory-limit: this system has no such limit; leave it out"));
    }
    let (source, out) = args.source_and_out()?;
    let options = args.options?;
    let all = of_shard(items(&source, &out)?, args.own.shard);
    let refuse = |path: &Path, e: std::io::Error| {
        Refusal::new(format!("{}: the folder cannot be made: {e}; give another --out", path.display()))
    };
    let reports = out.join("reports");
    std::fs::create_dir_all(&reports).map_err(|e| refuse(&reports, e))?;
    let out = std::path::absolute(&out).map_err(|e| refuse(&out, e))?;
    let (results, before) = Results::open(&out, args.own.shard, args.own.fresh)?;
    let program = std::env::current_exe()
        .map_err(|e| Refusal::new(format!("the program cannot find itself: {e}; call it by its whole path")))?;

    let asked = Arc::new(Asked::default());
    let handler = asked.clone();
    ctrlc::set_handler(move || handler.again())
        .map_err(|e| Refusal::new(format!("Ctrl-C cannot be listened to: {e}")))?;

    let processors = std::thread::available_parallelism().map_or(1, |n| n.get());
    let jobs = args.own.jobs.map_or(processors, |n| n as usize).clamp(1, all.len().max(1));
    let run = Run { program, out, options, memory: args.own.memory_limit, threads: (processors / jobs).max(1) };
    let mut tally = Tally::new(args.unwrap.solve.run.quiet, all.len(), results.path());
    let plan = Plan { run: &run, items: &all, before: &before, retry: args.own.retry_failed, asked: &asked };
    let complete = plan.carry_out(jobs, results, &mut tally);
    tally.say();
    if let Err(e) = complete {
        eprintln!("error: {e}");
        return Ok(1);
    }
    Ok(if asked.to_end() { CANCELLED } else { tally.exit_status() })
}

/// What is to be done, and what has been.
struct Plan<'a> {
    run: &'a Run,
    items: &'a [Item],
    before: &'a BTreeMap<String, Record>,
    retry: bool,
    asked: &'a Asked,
}

impl Plan<'_> {
    /// All items, `jobs` at a time. An error if a result cannot be written down; then no more are begun.
    fn carry_out(&self, jobs: usize, mut results: Results, tally: &mut Tally) -> Result<(), Refusal> {
        let next = AtomicUsize::new(0);
        let (sender, receiver) = mpsc::channel();
        std::thread::scope(|scope| {
            for _ in 0..jobs {
                let (sender, next) = (sender.clone(), &next);
                // Children die with the thread that started them: it waits for each.
                scope.spawn(move || {
                    while !self.asked.to_end()
                        && let Some(item) = self.items.get(next.fetch_add(1, Ordering::SeqCst))
                    {
                        // The receiver is there until all senders are gone.
                        let _ = sender.send(self.settle(item));
                    }
                });
            }
            drop(sender);
            let mut complete = Ok(());
            for (record, is_new) in receiver {
                if is_new && complete.is_ok() {
                    complete = results.add(&record);
                    if complete.is_err() {
                        self.asked.again();
                    }
                }
                tally.add(&record, is_new);
            }
            complete
        })
    }

    /// The result of an item, and whether it is a new one.
    fn settle(&self, item: &Item) -> (Record, bool) {
        let job = self.run.job(item);
        match self.before.get(&job.record.out) {
            Some(old) if self.is_done(old, &job.record, &job.target) => (old.clone(), false),
            _ => (job.run(self.asked), true),
        }
    }

    /// Whether a mesh has ended in a way that stands: same content, same options, and its map still there.
    fn is_done(&self, old: &Record, new: &Record, target: &Path) -> bool {
        let same = old.input_sha256 == new.input_sha256 && old.options_sha256 == new.options_sha256;
        let stands = match old.status {
            End::Converged => true,
            End::Cancelled => false,
            _ => !self.retry,
        };
        same && stands && (!old.written || target.is_file())
    }
}
