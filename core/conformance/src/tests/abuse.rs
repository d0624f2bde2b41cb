//! Tests of level 3: deadlines, cancellation, hard inputs, leaks.

use std::time::{Duration, Instant};

use platen_engine::plugin::{Advisor, CancelToken, Comparison, Flattening, JobSpec, Kind, Surfaces};
use platen_shape::{Flatten, FlattenError};

use crate::answer::{Any, of_advisor, of_comparison, of_flattening};
use crate::reference;
use crate::subject::{Subject, failed};
use crate::{Test, Verdict};

/// Number of jobs after which memory must not have grown.
const JOBS: usize = 12;
/// Growth of private memory that does not count as a leak, bytes.
const GROWTH: u64 = 16 << 20;
/// Memory limit within which a plate must be measured, bytes.
const LITTLE: u64 = 512 << 20;

pub(super) const TESTS: &[Test] = &[
    Test { name: "deadline.kept", level: 3, demands: "at a deadline it returns within 0.5 s", run: deadline },
    Test {
        name: "cancel.kept",
        level: 3,
        demands: "cancelled before and during a scan it returns within 0.5 s",
        run: cancel,
    },
    Test {
        name: "input.hard",
        level: 3,
        demands: "hard inputs are answered or refused with a sentence",
        run: hard,
    },
    Test {
        name: "leak.memory",
        level: 3,
        demands: "12 rounds of all references leave no memory behind",
        run: memory,
    },
    Test { name: "leak.files", level: 3, demands: "nor descriptors or threads", run: files },
    Test { name: "memory.little", level: 3, demands: "512 MiB are enough", run: little },
];

/// Returns the duration of all answers.
fn usual(subject: &Subject) -> Result<Duration, Verdict> {
    let mut any = Any::of(subject, subject.settings.limit)?;
    let start = Instant::now();
    any.answer(subject.settings.limit)
        .map_err(|verdict| Verdict::LeftOut(format!("it does not answer: {verdict:?}")))?;
    Ok(start.elapsed())
}

fn deadline(subject: &Subject) -> Result<(), Verdict> {
    // There are three or five reference inputs: a fifth of the time ends within the first job.
    let one = usual(subject)? / 5;
    for share in [0.0, 0.1, 0.5, 0.9] {
        let limit = one.mul_f64(share).max(Duration::from_millis(1));
        let mut any = Any::of(subject, limit)?;
        if let Err(Verdict::Failed(why)) = any.answer(limit)
            && ["hangs", "misbehaved", "its process ended"].iter().any(|fault| why.contains(fault))
        {
            return Err(failed(format!("deadline after {} ms: {why}", limit.as_millis())));
        }
    }
    Ok(())
}

fn cancel(subject: &Subject) -> Result<(), Verdict> {
    let usual = usual(subject)?;
    for share in [0.0, 0.1, 0.5, 0.9] {
        let scanner = subject.scanner()?;
        let token = CancelToken::default();
        let spec = JobSpec { cancel: token.clone(), ..JobSpec::untriggered(subject.settings.limit) };
        let when = Instant::now() + usual.mul_f64(share);
        let ended = scanner.start(spec, None).and_then(|mut scan| {
            while Instant::now() < when {
                if scan.next().transpose()?.is_none() {
                    break;
                }
            }
            token.cancel();
            scan.finish().map(drop)
        });
        if let Err(error) = ended
            && error.is_fault()
        {
            return Err(failed(format!("cancelled after {:.0} %: {error}", 100.0 * share)));
        }
    }
    Ok(())
}

fn hard(subject: &Subject) -> Result<(), Verdict> {
    match subject.kind()? {
        Kind::Flattening => {
            let mut flattening = subject.flattening(subject.settings.limit)?;
            for (name, plate) in reference::hard_meshes() {
                let mesh = plate.mesh().map_err(failed)?;
                match flattening.flatten(&mesh) {
                    Err(error @ FlattenError::NotAChart { .. }) => {
                        return Err(failed(format!("{name}: {error}")));
                    }
                    Err(error) if is_fault(&error.to_string()) => {
                        return Err(failed(format!("{name}: {error}")));
                    }
                    _ => {}
                }
            }
            Ok(())
        }
        Kind::Comparison => {
            let comparison = subject.comparison(subject.settings.limit)?;
            for (name, radius, seen) in
                [("nothing seen", 6.0, 0.0), ("a corner seen", 6.0, 0.02), ("rolled to 1 m", 1.0, 1.0)]
            {
                let now = reference::surface(radius, seen)
                    .ok_or_else(|| failed("the kit has no reference surface"))?;
                let surfaces = Surfaces { now: &now, before: None, baseline: None };
                match comparison.compare(&reference::task(true), surfaces) {
                    Err(error) if error.is_fault() => return Err(failed(format!("{name}: {error}"))),
                    _ => {}
                }
            }
            Ok(())
        }
        Kind::Advisor => {
            let advisor = subject.advisor(subject.settings.limit)?;
            for (name, radius, seen) in
                [("nothing seen", 6.0, 0.0), ("a corner seen", 6.0, 0.02), ("rolled to 1 m", 1.0, 1.0)]
            {
                let now = reference::surface(radius, seen)
                    .ok_or_else(|| failed("the kit has no reference surface"))?;
                match advisor.advise(&reference::history(1), &now, None, CancelToken::default()) {
                    Err(error) if error.is_fault() => return Err(failed(format!("{name}: {error}"))),
                    _ => {}
                }
            }
            Ok(())
        }
        Kind::Scanner => Ok(()),
    }
}

fn is_fault(error: &str) -> bool {
    ["its process ended", "misbehaved", "hangs"].iter().any(|fault| error.contains(fault))
}

fn memory(subject: &Subject) -> Result<(), Verdict> {
    let (first, last) = after_jobs(subject, |state| state.memory)?;
    if last <= first + GROWTH {
        Ok(())
    } else {
        Err(failed(format!("{} MiB more after {JOBS} rounds", (last - first) >> 20)))
    }
}

fn files(subject: &Subject) -> Result<(), Verdict> {
    let (first, last) = after_jobs(subject, |state| state.files)?;
    if last > first {
        return Err(failed(format!("{} descriptors more after {JOBS} rounds", last - first)));
    }
    let (first, last) = after_jobs(subject, |state| state.threads)?;
    if last > first {
        return Err(failed(format!("{} threads more after {JOBS} rounds", last - first)));
    }
    Ok(())
}

/// Returns a figure of the worker after the first answers and again after [`JOBS`] answers.
fn after_jobs(
    subject: &Subject,
    figure: fn(&platen_engine::plugin::WorkerState) -> Option<u64>,
) -> Result<(u64, u64), Verdict> {
    let mut any = Any::of(subject, subject.settings.limit)?;
    let unanswered = |verdict| match verdict {
        Verdict::Failed(why) => Verdict::LeftOut(why),
        other => other,
    };
    let read = |any: &Any| {
        let state = any.instance().worker_state();
        state.as_ref().and_then(figure).ok_or_else(|| Verdict::LeftOut("not in a process of its own".into()))
    };
    // Memory that is kept after the first job, such as a thread pool, is not a leak.
    for _ in 0..2 {
        any.answer(subject.settings.limit).map_err(unanswered)?;
    }
    let first = read(&any)?;
    for _ in 0..JOBS {
        any.answer(subject.settings.limit).map_err(unanswered)?;
    }
    Ok((first, read(&any)?))
}

fn little(subject: &Subject) -> Result<(), Verdict> {
    let library = subject.limited(LITTLE)?;
    let values = subject.values()?;
    let answer = match subject.kind()? {
        Kind::Flattening => {
            of_flattening(&mut Flattening::create(&library, values, subject.settings.limit).map_err(failed)?)
        }
        Kind::Comparison => {
            of_comparison(&Comparison::create(&library, values, subject.settings.limit).map_err(failed)?)
        }
        Kind::Advisor => {
            of_advisor(&Advisor::create(&library, values, subject.settings.limit).map_err(failed)?)
        }
        Kind::Scanner => return Ok(()),
    };
    match answer {
        Err(Verdict::Failed(why)) if is_fault(&why) => Err(failed(why)),
        _ => Ok(()),
    }
}
