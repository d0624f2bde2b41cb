//! Names of the fields of a register map, with dimension and meaning.
//!
//! Code refers to [`Input::StrokeId`], never to register 3; the plant file decides the place.

use platen_model::Measure;

use crate::Dimension;

/// Names of the fields of one direction.
pub(super) trait FieldName: Copy + Ord + 'static {
    const INPUT: bool;
    const ALL: &'static [Self];
    fn name(self) -> &'static str;
    fn dimension(self) -> Dimension;
}

/// Declares an enum with a name, a dimension and a meaning per variant.
macro_rules! names {
    ($(#[$outer:meta])* $kind:ident, $input:literal { $($variant:ident $name:literal $dimension:ident $meaning:literal)* }) => {
        $(#[$outer])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $kind { $(#[doc = $meaning] $variant,)* }

        impl $kind {
            /// All fields, in the order of the register map's page.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Returns the name in the plant file, in the log and on the map's page.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// Returns the meaning in one line.
            pub fn meaning(self) -> &'static str {
                match self { $(Self::$variant => $meaning,)* }
            }

            /// Returns the dimension, which decides the units allowed.
            pub fn dimension(self) -> Dimension {
                match self { $(Self::$variant => Dimension::$dimension,)* }
            }

            /// Returns the field of this name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|it| it.name() == name)
            }
        }

        impl FieldName for $kind {
            const INPUT: bool = $input;
            const ALL: &'static [Self] = Self::ALL;

            fn name(self) -> &'static str {
                self.name()
            }

            fn dimension(self) -> Dimension {
                self.dimension()
            }
        }

        impl serde::Serialize for $kind {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }

        impl<'de> serde::Deserialize<'de> for $kind {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let name = String::deserialize(deserializer)?;
                Self::from_name(&name).ok_or_else(|| serde::de::Error::custom(format!("no field `{name}`")))
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

names! {
    /// Field from the press to the host.
    Input, true {
        MapVersion "map_version" Count "version of this map; the host stays off line when it differs"
        Heartbeat "heartbeat" Count "counts up while the press controller runs"
        Enable "enable" Switch "strokes are to be measured"
        Trigger "trigger" Switch "a stroke is done and waits to be measured"
        Ack "ack" Switch "the result has been read"
        Abort "abort" Switch "give up the scan that is running"
        ErrorReset "error_reset" Switch "rising: clear latched errors and the count of missed strokes"
        ClearToScan "clear_to_scan" Switch "ram up and plate at rest"
        DryRun "dry_run" Switch "this stroke is a trial: measured and recorded as one"
        PartEnd "part_end" Switch "rising: the plate is finished and leaves"
        Rescan "rescan" Switch "measure the same stroke again, as the attempt that `attempt` counts"
        Baseline "baseline" Switch "with trigger: a scan of the plate before its first stroke"
        StrokeId "stroke_id" Count "number of the stroke, set before trigger; 0 is none"
        SessionId "session_id" Count "changes whenever the press controller restarts or the part changes"
        RecipeId "recipe_id" Count "number of the target shape"
        PressState "press_state" Count "0 unknown, 1 manual, 2 automatic, 3 down, 4 dwell, 5 up, 6 fault; for the record"
        PressId "press_id" Count "plant number of the press, against the wrong controller"
        PartId "part_id" Count "number of the plate"
        PartName "part_name" Text "name of the plate"
        BendIndex "bend_index" Count "number of the bend line in the recipe"
        Thickness "thickness" Length "thickness of the plate"
        PressForce "press_force" Force "largest force of the stroke"
        RamDepth "ram_depth" Length "deepest position of the ram"
        PlateX "plate_x" Length "feed position of the plate along x"
        PlateY "plate_y" Length "feed position of the plate along y"
        PlateRot "plate_rot" Angle "feed rotation of the plate"
        Temperature "temperature" Temperature "temperature of the plate"
        PlcUnixS "plc_unix_s" Count "time of the press controller, seconds since 1970 UTC"
        PlcMs "plc_ms" Count "milliseconds of that time"
        Attempt "attempt" Count "0 for the first measurement of a stroke, one more per rescan request"
        DieId "die_id" Count "die set in use, for the record"
        Crew "crew" Count "code of the crew, never of a person; recorded only where the plant file has the table crews"
        StrokeIdTail "stroke_id_tail" Count "copy of stroke_id, written before it; while they differ the block is being written"
    }
}

names! {
    /// Field from the host to the press.
    Output, false {
        MapVersion "map_version" Count "version of this map"
        Heartbeat "heartbeat" Count "counts up while the host runs; frozen for 2 s: ignore every result"
        StatusReady "status_ready" Switch "a stroke will be accepted"
        StatusBusy "status_busy" Switch "a stroke is being measured"
        StatusResultValid "status_result_valid" Switch "the result registers hold the result of the stroke that was accepted"
        StatusPass "status_pass" Switch "the plate is in tolerance"
        StatusFail "status_fail" Switch "the plate is not in tolerance"
        StatusError "status_error" Switch "an error is present; error_code, where there is one, gives the reason"
        StatusWarning "status_warning" Switch "a warning is present; warning_code, where there is one, gives the reason"
        StatusScanDone "status_scan_done" Switch "the scan is taken, the plate may move"
        StatusMissedStroke "status_missed_stroke" Switch "a stroke was not measured because it came too early; until error_reset"
        StatusSimulated "status_simulated" Switch "the result is simulated: never use it"
        StatusStorageDegraded "status_storage_degraded" Switch "results are not being recorded"
        StatusCalibrationInvalid "status_calibration_invalid" Switch "the scanner's calibration is not valid"
        StatusNotMeasured "status_not_measured" Switch "this stroke could not be measured; error_code, where there is one, gives the reason"
        StatusCannotTell "status_cannot_tell" Switch "measured, but too uncertain to judge: neither pass nor fail"
        AckStrokeId "ack_stroke_id" Count "the stroke that was accepted: echo of stroke_id"
        ResultStrokeId "result_stroke_id" Count "the stroke that the result belongs to"
        SessionEcho "session_echo" Count "session of the stroke that was accepted, and of its result"
        ErrorCode "error_code" Count "0 none; 1xx link, 2xx scanner, 3xx evaluation, 4xx storage, 5xx configuration"
        WarningCode "warning_code" Count "0 none; the alarm table has the texts"
        ResultSeq "result_seq" Count "one more per published result, written after it"
        MissedCount "missed_count" Count "strokes missed since error_reset; stays at 65535"
        DevMax "dev_max" Length "highest place above the best-fitting target, towards the scanner"
        DevMin "dev_min" Length "deepest place below the best-fitting target, negative"
        DevRms "dev_rms" Length "root mean square distance from the best-fitting target"
        DevP95 "dev_p95" Length "95 % of the plate lie nearer than this to the best-fitting target"
        InTol "in_tol" Ratio "share of the area that gaps by no more than the tolerance under the target laid on the plate"
        Tolerance "tolerance" Length "tolerance that was applied"
        Coverage "coverage" Ratio "share of the target that was measured"
        MaxX "max_x" Length "place of dev_max in the plate frame, u"
        MaxY "max_y" Length "place of dev_max in the plate frame, v"
        MinX "min_x" Length "place of dev_min in the plate frame, u"
        MinY "min_y" Length "place of dev_min in the plate frame, v"
        RadiusDev "radius_dev" Ratio "deviation of the curvature from the target's"
        Station "station" Length "figures at the stations of the plate file, in its order: deviation under the target laid on the plate, gap, or curvature deficit (then 1/km where it says mm)"
        ScanTime "scan_time" Time "duration of the scan"
        EvalTime "eval_time" Time "duration of the evaluation"
        StrokeToResultTime "stroke_to_result_time" Time "from the trigger to the result"
        UnixS "unix_s" Count "time of the scan, seconds since 1970 UTC"
        Ms "ms" Count "milliseconds of that time"
        RecipeEcho "recipe_echo" Count "recipe that the result was judged by"
        Owner "owner" Count "number of the host that writes here; another one is a second host"
        RunId "run_id" Count "key of the result's record"
        Crc16 "crc16" Count "CRC-16/MODBUS of the rows of this table in their order, high byte first, but for map_version, heartbeat, the status word, host_state, result_seq_tail and crc16; may be left unchecked"
        ResultSeqTail "result_seq_tail" Count "equals result_seq when the result is complete"
        HostState "host_state" Count "state of the host's handshake, for the log of the press"
        GapMax "gap_max" Length "largest gap under a template"
        GapUnc "gap_unc" Length "uncertainty of gap_max"
        GapU "gap_u" Length "place of gap_max in the plate frame, u"
        GapV "gap_v" Length "place of gap_max in the plate frame, v"
        GapLine "gap_line" Count "number of the template with the largest gap"
        Sense "sense" Count "-1 not bent enough, 0 within, +1 bent too far"
        AttemptEcho "attempt_echo" Count "attempt that was accepted, and of its result"
    }
}

/// Returns the dimension of a figure: that of its default field.
pub(crate) fn dimension_of(measure: Measure) -> Option<Dimension> {
    Output::ALL.iter().find(|output| output.measure() == Some(measure)).map(|output| output.dimension())
}

impl Output {
    /// Returns whether it is a bit of the status.
    pub fn is_status(self) -> bool {
        self.dimension() == Dimension::Switch
    }

    /// Returns the figure in this field by default (the key `from` replaces it); `None` for fields of the handshake and
    /// for the stations, which are a list.
    pub fn measure(self) -> Option<Measure> {
        Some(match self {
            Self::DevMax => Measure::DeviationMax,
            Self::DevMin => Measure::DeviationMin,
            Self::DevRms => Measure::DeviationRms,
            Self::DevP95 => Measure::DeviationP95,
            Self::InTol => Measure::InTolerance,
            Self::Tolerance => Measure::Tolerance,
            Self::Coverage => Measure::Coverage,
            Self::MaxX => Measure::DeviationMaxU,
            Self::MaxY => Measure::DeviationMaxV,
            Self::MinX => Measure::DeviationMinU,
            Self::MinY => Measure::DeviationMinV,
            Self::RadiusDev => Measure::CurvatureDeviation,
            Self::GapMax => Measure::GapMax,
            Self::GapUnc => Measure::GapUncertainty,
            Self::GapU => Measure::GapU,
            Self::GapV => Measure::GapV,
            Self::GapLine => Measure::GapLine,
            Self::Sense => Measure::Sense,
            Self::ScanTime => Measure::ScanTime,
            Self::EvalTime => Measure::EvaluateTime,
            Self::StrokeToResultTime => Measure::StrokeToResultTime,
            _ => return None,
        })
    }
}
