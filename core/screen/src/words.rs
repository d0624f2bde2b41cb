//! Texts of the pages in both languages. The texts of alarms are in the table of alarms (`platen_model::Code`).

use platen_model::{Language, Texts, Verdict, texts};
use platen_report::result::{Next, NoNext};

use crate::{ScannerState, Stage};

texts! { pub(crate),
    DONE "DONE" "完了"
    BEND_MORE "BEND MORE" "曲げ不足"
    TOO_FAR "BENT TOO FAR" "曲げ過ぎ"
    OUT_OF_TOLERANCE "OUT OF TOLERANCE" "公差外"
    CANNOT_TELL "CANNOT TELL" "判定不能"
    NOT_MEASURED "NOT MEASURED" "未測定"
    READY "READY" "準備完了"
    NOT_READY "NOT READY" "準備中"
    SCANNING "SCANNING" "スキャン中"
    MEASURING "MEASURING" "測定中"
    NO_LINK "NO CONNECTION" "プレス接続なし"
    NO_LINK_WHY "The press does not answer. No result is shown until it does." "プレスが応答しません。応答するまで結果は表示しません。"
    LISTENING "LISTENING ONLY" "監視のみ"
    LOST "NO CONNECTION" "接続なし"
    LOST_REMEDY "This page has lost platen. It shows nothing until it hears again." "platen と通信できません。再接続まで何も表示しません。"
    STUCK "STOPPED" "測定停止"
    STUCK_REMEDY "Measuring has stopped: the press cycle of platen stands still. Restart platen." "platen の動作が止まっています。再起動してください。"
    SIMULATED "SIMULATED: no real plate" "シミュレーション: 実物ではありません"
    TRIAL "TRIAL: nothing counts" "試運転"
    PRESS_AT "PRESS HERE" "次に押す位置"
    PRESS_AGAIN "PRESS HERE AGAIN" "同じ位置をもう一度"
    NOWHERE "No single place stands out" "突出した箇所はありません"
    NO_TARGET "No target to bend to" "目標形状がありません"
    NOT_SEEN "Too little seen, or the scanner is not calibrated" "測定範囲不足または校正なし"
    TURN_PLATE "No place to press: turn the plate" "押す位置なし: 板を裏返してください"
    NOTHING_TO_DO "Nothing to do" "作業不要"
    PRESS_LINE "PRESS ALONG THE LINE" "線に沿って押す"
    TURN_OVER "TURN OVER, PRESS ALONG THE LINE" "裏返して線に沿って押す"
    FAR_END "{}, far end {}" "{}、奥の端 {}"
    DEPTH "deep" "深さ"
    NOT_BEYOND "not beyond {}" "{} を超えない"
    THEN "then {} open ({} to {})" "この後のすき間 {} ({} ~ {})"
    STROKES_LEFT "{} to {} strokes left" "残り {} ~ {} 回"
    LAST_STROKE "Last stroke: advised {}, made {}" "直前: 助言 {}、実際 {}"
    RANGE "{} deg ({} to {})" "{}° ({} ~ {})"
    DEGREES "{} deg" "{}°"
    LAST_TOO_LATE "Last stroke: made before the advice was ready" "直前: 助言の準備前に押されました"
    NO_ADVICE "No advice: {}" "助言なし: {}"
    FROM_LEFT "from the left" "左から"
    FROM_PRESS "from the press" "プレス側から"
    FROM_BOTTOM "from the lower edge" "下端から"
    GAP "Template gap" "型板すき間"
    LIMIT "limit" "限度"
    STROKE "Stroke" "ストローク"
    BLANK "Blank" "素板"
    PLATE "Plate" "板"
    PRESS "Press" "プレス"
    SCANNER "Scanner" "スキャナ"
    RECORD "Record" "記録"
    IN_STEP "in step" "同期"
    OUT_OF_STEP "no answer" "応答なし"
    STANDS "program stands" "プログラム停止"
    SCANNER_UNKNOWN "not asked yet" "未確認"
    SCANNER_READY "ready" "準備完了"
    SCANNER_NOT_READY "not ready" "準備未完了"
    SCANNER_NOT_CALIBRATED "not calibrated" "未校正"
    COMPLETE "complete" "正常"
    LOST_RECORDS "lost" "欠落"
    MORE_ALARMS "more" "件"
    NO_PLATE "No plate" "板なし"
    OPERATOR "Operator" "オペレータ"
    STROKES "Strokes" "ストローク"
    COMPARE "Compare" "比較"
    ENGINEER "Engineer" "技術者"
    PLATE_3D "3D" "3D"
    MAP "Still to bend" "残りの曲げ"
    TIME "Time" "時刻"
    VERDICT "Verdict" "判定"
    WORST_GAP "Worst gap" "最大すき間"
    BENDS "Bends" "曲げ"
    FEED "Feed" "送り"
    REHIT "Hit again" "再打"
    OVERSHOOT "Overshoot" "行き過ぎ"
    FILES "Files" "ファイル"
    REPORT "Report" "報告書"
    NO_STROKES "No stroke is on record yet." "記録されたストロークはありません。"
    CHOOSE_TWO "Choose two strokes of a plate on the page of its strokes." "ストロークのページで二つ選んでください。"
    FIGURE "Figure" "項目"
    SECTIONS "section under the template, a dashed, b solid; height of the picture" "型板下の断面 (a 破線, b 実線)、図の高さ"
    NO_CHANGE "no significant change" "有意な変化なし"
    OTHER_PLATE "Two different plates or plate files: figures only, no maps side by side." "板または板ファイルが異なるため、数値のみ比較します。"
    REGISTERS_READ "Registers read from the press" "プレスから読むレジスタ"
    REGISTERS_WRITTEN "Registers written to the press" "プレスに書くレジスタ"
    TIMELINE "Last strokes, milliseconds from the trigger" "直近のストローク (トリガからのミリ秒)"
    PLUGINS "Plugins" "プラグイン"
    ALARMS "Alarms since the start" "起動後のアラーム"
    STATE "State" "状態"
    FILES_IN_FORCE "Files in force" "使用中のファイル"
    DIAGNOSIS "Save diagnosis" "診断を保存"
    NAME "Name" "名前"
    VALUE "Value" "値"
    CODE "Number" "番号"
    TEXT "Text" "内容"
    COUNT "Count" "回数"
    ADDRESS "Address" "アドレス"
    WORDS "Words" "ワード数"
    USE "Use" "用途"
    VERSION "Version" "版"
    FILE "File" "ファイル"
    CHECKSUM "Checksum" "チェックサム"
    SCAN_END "scanned" "スキャン"
    RESULT "result" "結果"
    ACKNOWLEDGED "acknowledged" "確認"
    HEIGHT "Height" "高さ"
    ABOVE "Above" "真上"
    NO_WEBGL "This browser has no WebGL: the map instead." "このブラウザは WebGL に対応していません。地図を表示します。"
}

/// Returns the words of a verdict for the band: -1 is bent too little, 1 too far.
pub(crate) fn verdict(verdict: Verdict, sense: i8) -> Texts {
    match (verdict, sense) {
        (Verdict::Pass, _) => DONE,
        (Verdict::Fail, ..=-1) => BEND_MORE,
        (Verdict::Fail, 1..) => TOO_FAR,
        (Verdict::Fail, 0) => OUT_OF_TOLERANCE,
        (Verdict::CannotTell, _) => CANNOT_TELL,
        (Verdict::NotMeasured, _) => NOT_MEASURED,
    }
}

/// Returns the heading over the place of the next hit; `again` where an earlier stroke bent the plate there.
pub(crate) fn next(next: &Next, again: bool) -> Texts {
    match next {
        Next::Place(_) if again => PRESS_AGAIN,
        Next::Place(_) => PRESS_AT,
        Next::Nowhere { none } => match none {
            NoNext::Passed => NOTHING_TO_DO,
            NoNext::NothingStandsOut => NOWHERE,
            NoNext::BentTooFar => TURN_PLATE,
            NoNext::NoTarget => NO_TARGET,
            NoNext::NotEnoughSeen => NOT_SEEN,
        },
    }
}

/// Returns the words of a stage before the result.
pub(crate) fn stage(stage: Stage) -> Texts {
    match stage {
        Stage::Accepted | Stage::Scanning => SCANNING,
        Stage::Measuring | Stage::Ending => MEASURING,
        Stage::Done => READY,
    }
}

/// Returns the words of the scanner's state.
pub(crate) fn scanner(state: ScannerState) -> Texts {
    match state {
        ScannerState::Unknown => SCANNER_UNKNOWN,
        ScannerState::Ready => SCANNER_READY,
        ScannerState::NotReady => SCANNER_NOT_READY,
        ScannerState::NotCalibrated => SCANNER_NOT_CALIBRATED,
    }
}

/// Returns stroke number and attempt, counted from 1: `7`, `7 (attempt 2)`.
pub(crate) fn number(number: u16, attempt: u16, language: Language) -> String {
    match (attempt, language) {
        (0, _) => number.to_string(),
        (n, Language::En) => format!("{number} (attempt {})", n + 1),
        (n, Language::Ja) => format!("{number} ({}回目)", n + 1),
    }
}

/// Returns the line of an alarm: number, fault, remedy.
pub(crate) fn alarm(alarm: &crate::ShownAlarm, language: Language) -> String {
    format!("{} {}; {}", alarm.code.number(), alarm.text.of(language), alarm.remedy.of(language))
}
