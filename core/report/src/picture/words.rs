//! Words of pictures in each language, one row each.

pub(super) use platen_model::fill;
use platen_model::{Texts, Verdict, texts};

texts! { pub(super),
    BEND_MORE "bend more" "曲げ不足"
    TOO_FAR "bent too far" "曲げ過ぎ"
    ENOUGH "enough" "十分"
    NO_CHANGE "no change" "変化なし"
    NO_DATA "no data" "データなし"
    MEANS "numbers: means" "数字: 平均値"
    NEXT_HIT "next hit" "次に押す位置"
    PRESS "press" "プレス"
    FROM_LEFT "from the left" "左から"
    FROM_PRESS "from the press" "プレス側から"
    STILL_TO_BEND "Still to bend, as the gap it makes under a {} template" "残りの曲げ ({} の型板のすき間に換算)"
    BENT "Bent by this stroke, as the gap it makes under a {} template" "このストロークの曲げ ({} の型板のすき間に換算)"
    DEVIATION "Deviation from the target{}" "目標形状との偏差{}"
    MOVED "Moved since the previous scan{}" "前回スキャンからの移動{}"
    KAPPA_U "Curvature along u{}" "u 方向の曲率{}"
    KAPPA_V "Curvature along v{}" "v 方向の曲率{}"
    KAPPA_UV "Twist{}" "ねじれ{}"
    KAPPA_MAX "Larger principal curvature{}" "主曲率 (大){}"
    KAPPA_MIN "Smaller principal curvature{}" "主曲率 (小){}"
    TOWARDS ", + towards the scanner" " (+ はスキャナ側)"
    OWN_SCALE "; scale of this stroke alone" " (このストロークのみの目盛)"
    SECTION "Template {} of {} on line {}, seat {}{}" "型板 {} ({})、基準線 {}、当て方 {}{}"
    GRAVITY "gravity" "自重"
    BALANCED "balanced" "両端均等"
    HELD "held" "両端接触"
    ROCKS ", it rocks" "、がたつきあり"
    TEMPLATE "template" "型板"
    ENLARGED "heights {} times enlarged; triangles: contacts" "高さは {} 倍に拡大、三角: 接触点"
    NO_PROFILE "no profile" "断面なし"
    GAP "gap" "すき間"
    LIMIT "limit" "許容値"
    ALONG "along the line" "基準線に沿って"
    STRIP "Worst gap under a template, {}, stroke by stroke" "ストロークごとの型板の最大すき間, {}"
    STROKE "stroke" "ストローク"
    PASS "pass" "合格"
    CANNOT_TELL "cannot tell" "判定不能"
    FAIL "fail" "不合格"
    NOT_MEASURED "not measured" "未測定"
}

/// Returns the words of a verdict.
pub(super) fn verdict(verdict: Verdict) -> Texts {
    match verdict {
        Verdict::Pass => PASS,
        Verdict::CannotTell => CANNOT_TELL,
        Verdict::Fail => FAIL,
        Verdict::NotMeasured => NOT_MEASURED,
    }
}

#[cfg(test)]
mod tests {
    use platen_model::Language;

    use super::*;

    #[test]
    fn the_places_of_a_text_are_filled_in_order() {
        assert_eq!(fill("a {} b{}", &["1", "{}"]), "a 1 b{}");
        assert_eq!(
            fill(SECTION.of(Language::Ja), &["T", "2 m", "R", "自重", ""]),
            "型板 T (2 m)、基準線 R、当て方 自重"
        );
    }

    #[test]
    fn english_verdicts_are_those_of_the_documents() {
        for each in [Verdict::Pass, Verdict::CannotTell, Verdict::Fail, Verdict::NotMeasured] {
            assert_eq!(verdict(each).of(Language::En), each.words());
        }
    }
}
