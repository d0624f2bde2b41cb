//! Figures of a measurement: a value for each [`Measure`], in one unit system.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Generates the measures from one list: variant, name and meaning.
macro_rules! measures {
    ($($variant:ident $name:literal $meaning:literal)*) => {
        /// A figure of a measurement, in the units inside: metres, radians, seconds, shares of one.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum Measure { $(#[doc = $meaning] #[serde(rename = $name)] $variant,)* }

        impl Measure {
            /// Every measure.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Returns the name in findings, in the plant file and in the record.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }
        }
    };
}

measures! {
    DeviationMax "deviation.max" "highest place above the best-fitting target, towards the scanner"
    DeviationMin "deviation.min" "deepest place below the best-fitting target, negative"
    DeviationRms "deviation.rms" "root mean square distance from the best-fitting target"
    DeviationP95 "deviation.p95" "95 % of the plate lie nearer than this to the best-fitting target"
    InTolerance "in_tolerance" "share of the area that gaps by no more than the tolerance under the target laid on the plate"
    Tolerance "tolerance" "tolerance that was applied"
    Coverage "coverage" "share of the target that was measured"
    DeviationMaxU "deviation.max_u" "place of the highest place, u"
    DeviationMaxV "deviation.max_v" "place of the highest place, v"
    DeviationMinU "deviation.min_u" "place of the deepest place, u"
    DeviationMinV "deviation.min_v" "place of the deepest place, v"
    CurvatureDeviation "curvature.deviation" "deviation of the curvature from the target's"
    GapMax "gap.max" "largest gap under a template"
    GapUncertainty "gap.uncertainty" "uncertainty of the largest gap"
    GapU "gap.u" "place of the largest gap, u"
    GapV "gap.v" "place of the largest gap, v"
    GapLine "gap.line" "number of the template with the largest gap"
    Sense "sense" "-1 not bent enough, 0 within, +1 bent too far"
    ScanTime "scan_time" "duration of the scan"
    EvaluateTime "evaluate_time" "duration of the evaluation"
    StrokeToResultTime "stroke_to_result_time" "from the trigger to the result"
    ClockError "clock.error" "largest error of the host's clock; absent while it is not synchronised"
}

impl Measure {
    /// Returns the measure of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|measure| measure.name() == name)
    }
}

/// Figures of a measurement, in metres, radians, seconds and shares of one. An absent figure was not measured; its
/// register holds the invalid value, never 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Figures {
    /// Values by measure.
    pub values: BTreeMap<Measure, f64>,
    /// Values at the configured stations, in their order.
    pub stations: Vec<Option<f64>>,
}
