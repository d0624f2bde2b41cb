//! Advice for the next stroke: the output of an advisor, JSON across the plugin boundary (`platen.advice/1`).

use serde::{Deserialize, Serialize};

use crate::{Sentence, Texts, texts};

/// Advice for the next stroke of a plate. It is displayed and recorded; it commands nothing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Advice {
    /// What to do.
    pub step: Step,
    /// Fewest strokes that the plan still needs, and the number that is seldom exceeded; `None` where nobody can promise one.
    pub strokes_left: Option<[u32; 2]>,
    /// The whole plan, the next bend first.
    pub plan: Vec<PlannedBend>,
    /// Middles of zones that are bent too far (u, v), metres.
    pub too_far: Vec<[f64; 2]>,
    /// Sentences for the operator, most important first.
    pub says: Vec<Sentence>,
    /// Depth law of the press as learned.
    pub model: Option<PressModel>,
}

/// Next action on the plate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Step {
    /// Bend along a line.
    Bend(NextBend),
    /// Bend at this place; no angle is given, as the plate stretches.
    Place {
        /// Place (u, v), metres.
        at: [f64; 2],
        /// Direction of the bend line, from u towards v, radians.
        direction: f64,
    },
    /// Turn the plate over and bend it back along a line.
    TurnOver(NextBend),
    /// Every template passes: enough.
    Done,
    /// No advice.
    Cannot {
        /// Reason.
        reason: CannotAdvise,
    },
}

/// The next bend, with the intervals (95 %) of what it will give.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NextBend {
    /// Ends of the bend line on the edges of the plate, (u, v), metres.
    pub line: [[f64; 2]; 2],
    /// Direction of the line, from u towards v, radians.
    pub direction: f64,
    /// Angle that should remain, radians.
    pub angle: f64,
    /// Interval of the angle that will remain.
    pub angle_95: [f64; 2],
    /// Half width of the interval of the bend's place about the line, metres; `None` where none is given.
    #[serde(default)]
    pub place_95: Option<f64>,
    /// Depth of the ram below its touch on a flat plate of nominal thickness, metres; `None` without a die opening, or on a press that
    /// does not report its depth.
    pub depth: Option<f64>,
    /// Depth beyond which the plate could no longer be finished by bends of one side.
    pub depth_not_beyond: Option<f64>,
    /// Largest gap under a template after this stroke, metres: lower end of its interval, expected, upper end.
    pub gap_after: [f64; 3],
    /// Name of the template with that gap.
    pub template: String,
    /// The limit of that template, metres.
    pub limit: f64,
}

/// A bend of the plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PlannedBend {
    /// Ends of the bend line, (u, v), metres.
    pub line: [[f64; 2]; 2],
    /// Angle, radians.
    pub angle: f64,
}

/// Depth law of the press as learned with this plate: posterior of its offset and slope.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PressModel {
    /// Earlier plates that it started from.
    pub like_plates: u32,
    /// Strokes of this plate that taught it.
    pub strokes_learned: u32,
    /// Offset of the depth law, metres.
    pub offset: f64,
    /// Slope of the depth law beyond its closed form, metres per radian.
    pub slope: f64,
    /// Covariance of offset and slope, row by row.
    pub covariance: [[f64; 2]; 2],
    /// Standard deviation of the next angle, radians.
    pub sigma_angle: f64,
    /// Standard deviation of reported minus wanted depth, metres.
    pub ram_sigma: f64,
    /// Distance by which the bends lie off the advised lines, metres, positive onward.
    pub off_mark: f64,
}

/// Reason why there is no advice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum CannotAdvise {
    /// The plate file has no target, or one that no bends along lines can make.
    NoTarget,
    /// No template lies across the bends.
    NoTemplate,
    /// A part of the plate under a template was not seen.
    Unseen,
    /// The bends of a stroke are not known: the advice began later, or the plant has no comparison `curvature`.
    BendsUnknown,
    /// Templates across the plate ask for different bends of one line.
    TemplatesDisagree,
    /// What is missing lies nearer to an edge than the die reaches.
    EdgeOutOfReach,
    /// The last three strokes lay outside their 99 % intervals.
    PressUnlikeRecord,
    /// The plate is bent too far and may not be turned over.
    BentTooFar,
    /// The plate lies on other supports than at the scan before, so that its own weight bends it otherwise.
    SupportsChanged,
    /// The bends on record have strained the face, wherever more are needed, to the largest strain allowed.
    StrainReached,
    /// The next stroke was made, or the plate taken away, before the advice was ready. The host says this of an advisor, never an advisor itself.
    TooLate,
}

texts! { pub(crate),
    NO_TARGET "no target that bends along lines can reach, or none at all" "曲げ線で到達できる目標形状がありません"
    NO_TEMPLATE "no template lies across the bends: add one to the plate file" "曲げ方向を横切る型板がありません: 板ファイルに追加してください"
    UNSEEN "a part of the plate under a template was not seen: clear the view and scan again" "型板下に見えない部分があります: 視界を確保して再スキャンしてください"
    BENDS_UNKNOWN "the bends of earlier strokes are not known: advice begins with the next plate that is scanned before its first stroke" "以前の曲げが不明です: 最初のストローク前にスキャンした板から助言を始めます"
    DISAGREE "the templates ask for different bends of one line: shim the bed or tilt the ram" "型板ごとに必要な曲げが異なります: 敷板またはラムの傾きを調整してください"
    EDGE "what is missing lies nearer to an edge than the die reaches: narrower die, pre-bend or trim" "端部の不足分に金型が届きません: 狭い金型、端曲げ、または切断が必要です"
    UNLIKE "the press does not do what the record says: check die, zero and steel" "プレスの動作が記録と一致しません: 金型、原点、鋼種を確認してください"
    TOO_FAR "the plate is bent too far: flatten it; this press may not turn it over" "曲げ過ぎです: 平らに戻してください (裏返し不可)"
    SUPPORTS "the plate lies on other supports than at the scan before: its weight bends it otherwise; lay it as before, or judge the next stroke yourself" "支持が前回と異なり、自重によるたわみが変わっています: 支持を元に戻すか、次の曲げは作業者が判断してください"
    STRAIN "the bends have strained the face of the plate as far as is allowed (strain_max_percent): ask the engineer before you bend there again" "曲げによる板表面のひずみが許容値 (strain_max_percent) に達しています: 再度曲げる前に技術者に確認してください"
    TOO_LATE "the next stroke was made, or the plate taken away, before the advice was ready" "助言の準備ができる前に次のストロークまたは板の搬出が行われました"
}

impl CannotAdvise {
    /// Returns the number in the advice registers; numbers are never given anew.
    #[must_use]
    pub fn number(self) -> u16 {
        match self {
            Self::NoTarget => 1,
            Self::NoTemplate => 2,
            Self::Unseen => 3,
            Self::BendsUnknown => 4,
            Self::TemplatesDisagree => 5,
            Self::EdgeOutOfReach => 6,
            Self::PressUnlikeRecord => 7,
            Self::BentTooFar => 8,
            Self::SupportsChanged => 9,
            Self::StrainReached => 10,
            Self::TooLate => 11,
        }
    }

    /// Returns the sentence for the operator.
    #[must_use]
    pub fn texts(self) -> Texts {
        match self {
            Self::NoTarget => NO_TARGET,
            Self::NoTemplate => NO_TEMPLATE,
            Self::Unseen => UNSEEN,
            Self::BendsUnknown => BENDS_UNKNOWN,
            Self::TemplatesDisagree => DISAGREE,
            Self::EdgeOutOfReach => EDGE,
            Self::PressUnlikeRecord => UNLIKE,
            Self::BentTooFar => TOO_FAR,
            Self::SupportsChanged => SUPPORTS,
            Self::StrainReached => STRAIN,
            Self::TooLate => TOO_LATE,
        }
    }
}
