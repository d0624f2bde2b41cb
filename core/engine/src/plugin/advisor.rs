//! Advisor plugins: they compute advice on the next stroke from the history and the surface of a plate.

use std::time::Duration;

use platen_model::{Advice, NextBend, PlateHistory, Step};
use platen_plant::OptionValue;
use platen_shape::Surface;

use super::worker::printable;
use super::{CancelToken, InputFrame, Instance, Kind, Library, PluginError};

/// A configured advisor.
#[derive(Debug)]
pub struct Advisor {
    instance: Instance,
    limit: Duration,
}

/// Longest sentence, characters; longer ones are cut. Below: largest number of sentences; the first are the most
/// important.
const SENTENCE: usize = 500;
const SENTENCES: usize = 20;
/// Rounding allowed for places on the edge of the plate, metres.
const ON_EDGE: f64 = 1e-6;
/// Largest bend of one stroke that is accepted, radians.
const MOST: f64 = 1.0;

impl Advisor {
    /// Creates an advisor from checked options; `limit` is the deadline of one advice.
    ///
    /// # Errors
    /// As [`Instance::create`].
    pub fn create(library: &Library, values: &[OptionValue], limit: Duration) -> Result<Self, PluginError> {
        let instance = Instance::create(library, Kind::Advisor, values)?;
        instance.open(limit)?;
        Ok(Self { instance, limit })
    }

    /// Returns the instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Requests the advice on the next stroke and checks the answer. `cancel` ends the job early, with an error. An
    /// advisor that fails is not run again for the same stroke.
    ///
    /// # Errors
    /// The plugin's reason, the deadline, or the violation in its answer.
    pub fn advise(
        &self,
        history: &PlateHistory,
        now: &Surface,
        baseline: Option<&Surface>,
        cancel: CancelToken,
    ) -> Result<Advice, PluginError> {
        let mut inputs = vec![self.instance.input(history, None)?, self.instance.input(now, Some(c"now"))?];
        inputs.extend(baseline.map(|blank| self.instance.input(blank, Some(c"baseline"))).transpose()?);
        let spec = super::JobSpec { cancel, ..self.instance.evaluation(self.limit) };
        self.run(spec, &inputs, [history.task.width, history.task.height])
    }

    fn run(
        &self,
        spec: super::JobSpec,
        inputs: &[InputFrame],
        size: [f64; 2],
    ) -> Result<Advice, PluginError> {
        let mut job = self.instance.run(spec, inputs)?;
        let mut advice = None;
        while let Some(frame) = job.next_frame() {
            if !frame.is::<Advice>() || advice.is_some() {
                return Err(job.misbehaved(format!("a frame {} out of turn", frame.format)));
            }
            let read = frame.decode::<Advice>();
            advice = Some(read.map_err(|e| job.misbehaved(format!("an advice that cannot be read: {e}")))?);
        }
        job.finish()?;
        let advice = advice.ok_or_else(|| job.misbehaved("success without an advice"))?;
        checked(advice, size).map_err(|what| job.misbehaved(what))
    }
}

/// Checks the advice before it is shown: lines on the plate, intervals in order, sentences without control characters.
fn checked(mut advice: Advice, size: [f64; 2]) -> Result<Advice, String> {
    let on_plate =
        |at: &[f64; 2]| at.iter().zip(size).all(|(x, length)| (-ON_EDGE..=length + ON_EDGE).contains(x));
    let line = |line: &[[f64; 2]; 2]| {
        if line.iter().all(on_plate) {
            Ok(())
        } else {
            Err(format!("a bend line at {line:?}, off the plate"))
        }
    };
    match &advice.step {
        Step::Bend(bend) | Step::TurnOver(bend) => {
            line(&bend.line)?;
            in_order(bend)?;
        }
        Step::Place { at, .. } if !on_plate(at) => return Err(format!("a place at {at:?}, off the plate")),
        Step::Place { .. } | Step::Done | Step::Cannot { .. } => {}
    }
    advice.plan.iter().try_for_each(|bend| line(&bend.line))?;
    if let Some([few, many]) = advice.strokes_left
        && few > many
    {
        return Err(format!("{few} to {many} strokes left"));
    }
    advice.says.truncate(SENTENCES);
    for text in advice.says.iter_mut().flat_map(|says| [&mut says.en, &mut says.ja]) {
        *text = printable(text).chars().take(SENTENCE).collect();
    }
    Ok(advice)
}

fn in_order(bend: &NextBend) -> Result<(), String> {
    let [low, high] = bend.angle_95;
    if !(low <= bend.angle && bend.angle <= high && bend.angle.abs() <= MOST) {
        return Err(format!("an angle of {} in the interval {:?}", bend.angle, bend.angle_95));
    }
    let [low, expected, high] = bend.gap_after;
    if !(0.0 <= low && low <= expected && expected <= high) {
        return Err(format!("a gap after the stroke of {:?}", bend.gap_after));
    }
    match (bend.depth, bend.depth_not_beyond) {
        (Some(depth), Some(most)) if most < depth => Err(format!("a depth of {depth}, not beyond {most}")),
        _ => Ok(()),
    }
}
