//! Sentences of an advice, in each language.

use platen_model::units::mm;
use platen_model::{PlateHistory, Sentence, texts};

use crate::past::{Past, YIELD};

/// Half width of a 95 % interval, standard deviations.
const P95: f64 = 1.96;
/// Least number of strokes and least distance, metres, from which an offset of the die is reported.
const OFF_MARK: (usize, f64) = (3, 0.012);
/// Number of like plates, and of strokes of this plate, below which the advice states that little has been learned.
const FEW: u32 = 3;
/// Least distance of a short stop that is reported, metres.
const SHORT: f64 = 0.3e-3;

texts! { pub(crate),
    NO_DIE "no depth: the plant file names no [[die]] of the number that the press reports" "深さなし: プレスが示す番号の [[die]] がプラントファイルにありません"
    DEPTH_NOT_REPORTED "no depth: the press does not report the depth of its ram" "深さなし: プレスからラム深さが届きません"
    STEEL_ASSUMED "no [steel] in the plate file: {} MPa assumed" "板ファイルに [steel] がありません: {} MPa と仮定します"
    FIRST_MORE "the plate bent more than expected: check its thickness and steel, and the die" "予想より大きく曲がりました: 板厚、鋼種、金型を確認してください"
    FIRST_LESS "the plate bent less than expected: check its thickness and steel, and the die" "予想より曲がりませんでした: 板厚、鋼種、金型を確認してください"
    LAST_MORE "the last stroke bent the plate more than expected" "直前のストロークは予想より大きく曲がりました"
    LAST_LESS "the last stroke bent the plate less than expected" "直前のストロークは予想より曲がりませんでした"
    STOPPED_SHORT "the last stroke stopped {} mm short of the advised depth" "直前のストロークは助言の深さに {} mm 届きませんでした"
    MISSED "a stroke before the last one was not measured: the depth of the last one teaches nothing" "直前のストロークの前に未測定のものがあります: 深さは学習に使いません"
    OFF_ONWARD "the bends lie {} mm onward of the advised lines; the advice allows for it" "曲げ位置が助言の線より {} mm 先にあります (助言に反映済み)"
    OFF_BACK "the bends lie {} mm back of the advised lines; the advice allows for it" "曲げ位置が助言の線より {} mm 手前にあります (助言に反映済み)"
    RE_HIT "the line lies on an earlier bend: no other one reaches the limit" "線は以前の曲げの上です: 他の線では許容値に届きません"
    MORE_BENT "under {} the plate is more bent than under the other templates, by up to {} mm of gap: no whole line mends it; shim the bed or tilt the ram" "{} の下は他の型板より曲がっています (すき間 {} mm まで): 全長の曲げでは直せません。敷板またはラムの傾きを調整してください"
    FLATTER "under {} the plate is flatter than under the other templates, by up to {} mm of gap: no whole line mends it; shim the bed or tilt the ram" "{} の下は他の型板より平らです (すき間 {} mm まで): 全長の曲げでは直せません。敷板またはラムの傾きを調整してください"
    FLATTEN_LAST "bent too far around {} mm along u, {} mm along v: flatten there last" "u {} mm、v {} mm 付近は曲げ過ぎです: そこは最後に平らに戻してください"
    LEARNED "learned from {} like plates and {} strokes: the intervals are still wide" "学習: 同種の板 {} 枚、ストローク {} 回 (区間はまだ広い)"
    STRETCHES "bending both ways stretches the plate: only the place is given, neither angle nor gap" "二方向の曲げは板を伸ばします: 位置だけを示し、角度とすき間は示しません"
}

/// Returns the sentence on a press that is too coarse for the limit.
pub(crate) fn of_press(past: &Past, history: &PlateHistory) -> Vec<Sentence> {
    past.press(history)
        .filter(|press| press.is_too_coarse())
        .map(|press| press.sentence())
        .into_iter()
        .collect()
}

/// Returns sentences on press and plate file that follow from the strokes so far, the most important first.
pub(crate) fn of_strokes(past: &Past, history: &PlateHistory) -> Vec<Sentence> {
    let say = |texts| Sentence::new(texts, &[]);
    let Some(learner) = &past.learner else { return vec![say(NO_DIE)] };
    let mut says = Vec::new();
    if !history.tells_depth || !history.strokes.is_empty() && !past.depth_reported {
        says.push(say(DEPTH_NOT_REPORTED));
    }
    if history.strokes.last().is_some_and(|stroke| stroke.missed_before) {
        says.push(say(MISSED));
    }
    if let Some(short) = past.short.filter(|short| *short > SHORT) {
        says.push(Sentence::new(STOPPED_SHORT, &[&format!("{:.1}", mm(short))]));
    }
    if let [before @ .., surprise] = &learner.surprises[..]
        && surprise.abs() > P95
    {
        says.push(say(match (before.is_empty(), *surprise > 0.0) {
            (true, true) => FIRST_MORE,
            (true, false) => FIRST_LESS,
            (false, true) => LAST_MORE,
            (false, false) => LAST_LESS,
        }));
    }
    let off = learner.off_mark();
    if past.marks >= OFF_MARK.0 && off.abs() > OFF_MARK.1 {
        let texts = if off > 0.0 { OFF_ONWARD } else { OFF_BACK };
        says.push(Sentence::new(texts, &[&format!("{:.0}", mm(off.abs()))]));
    }
    let strokes = learner.model(0.0, 0.0).strokes_learned;
    if strokes < FEW && history.like.is_none_or(|like| like.plates < FEW) {
        let plates = history.like.map_or(0, |like| like.plates).to_string();
        says.push(Sentence::new(LEARNED, &[&plates, &strokes.to_string()]));
    }
    if history.steel.is_none() {
        says.push(Sentence::new(STEEL_ASSUMED, &[&format!("{:.0}", YIELD * 1e-6)]));
    }
    says
}
