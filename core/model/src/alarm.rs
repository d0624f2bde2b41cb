//! Alarm table: the only source of code, text and remedy for the registers, the log, `status` and the alarm list of the
//! HMI.

use serde::{Deserialize, Serialize};

use crate::{Language, Texts};

/// Severity of an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Measuring is affected: `error_code`, latched until reset.
    Error,
    /// Attention required: `warning_code`.
    Warning,
}

impl Severity {
    /// Returns the name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
        }
    }
}

/// Audience of an alarm: the person who must act.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Audience {
    /// The person at the press: shown on the operator's screen.
    Operator,
    /// The person who maintains the installation: shown on the engineer's page alone.
    Engineer,
}

/// Row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Alarm {
    /// Number.
    pub code: Code,
    /// Severity.
    pub severity: Severity,
    /// Person who must act.
    pub audience: Audience,
    /// Fault.
    pub texts: Texts,
    /// Remedy.
    pub remedies: Texts,
}

impl Alarm {
    /// Returns the fault.
    pub fn text(&self, language: Language) -> &'static str {
        self.texts.of(language)
    }

    /// Returns the remedy.
    pub fn remedy(&self, language: Language) -> &'static str {
        self.remedies.of(language)
    }
}

/// Generates the codes and the table from one list.
macro_rules! alarms {
    ($($code:ident = $number:literal $severity:ident $audience:ident $text_en:literal $remedy_en:literal $text_ja:literal $remedy_ja:literal)*) => {
        /// Number of an alarm: 1xx link and strokes, 2xx scanner, 3xx evaluation, 4xx storage, 5xx configuration.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(into = "u16", try_from = "u16")]
        pub enum Code { $(#[doc = $text_en] $code = $number,)* }

        impl Code {
            /// All codes, by number.
            pub const ALL: &'static [Self] = &[$(Self::$code,)*];

            /// Returns the code's row of the table.
            pub fn alarm(self) -> &'static Alarm {
                match self {
                    $(Self::$code => &Alarm {
                        code: Self::$code,
                        severity: Severity::$severity,
                        audience: Audience::$audience,
                        texts: Texts { en: $text_en, ja: $text_ja },
                        remedies: Texts { en: $remedy_en, ja: $remedy_ja },
                    },)*
                }
            }
        }
    };
}

alarms! {
    PressUnreachable = 101 Error Operator "the press does not answer" "check that the press is on, the cable, host, port and unit in [press.link]"
        "プレスが応答しません" "プレスの電源、ケーブル、[press.link] の host・port・unit を確認してください"
    LinkBroken = 102 Warning Engineer "the link to the press broke and is being rebuilt" "nothing if rare; else check cable, switch and response_timeout_ms"
        "プレスとの通信が切れ、再接続中です" "まれなら不要。頻発するならケーブル、スイッチ、response_timeout_ms を確認してください"
    PressStale = 103 Warning Operator "the heartbeat of the press stands still" "check that the press program runs"
        "プレスのハートビートが止まっています" "プレスのプログラムが動作しているか確認してください"
    TornBlock = 104 Warning Engineer "the press is changing its registers at every read" "write stroke_id_tail first and stroke_id last, then leave both alone"
        "プレスのレジスタが読み取りのたびに変化しています" "stroke_id_tail、stroke_id の順に書き、その後は変更しないでください"
    SecondHost = 105 Error Operator "another host writes to this press" "stop one of the two, then reset"
        "別のホストがこのプレスに書き込んでいます" "どちらか一方を停止してからリセットしてください"
    IllegalFunction = 106 Error Operator "the press refuses the Modbus function (exception 01)" "allow functions 3 and 16 on the press controller"
        "プレスが Modbus 機能を拒否しました (例外 01)" "プレス側で機能コード 3 と 16 を許可してください"
    IllegalAddress = 107 Error Operator "the press refuses a register address or value (exception 02 or 03)" "compare [press.map] with the controller's register table"
        "プレスがレジスタのアドレスまたは値を拒否しました (例外 02/03)" "[press.map] とプレス側のレジスタ表を照合してください"
    DeviceFailure = 108 Error Operator "the press controller reports a failure (exception 04, 08 or unknown)" "look at the controller's diagnostics, then reset"
        "プレスの制御装置が異常を返しました (例外 04/08 等)" "制御装置の診断を確認し、リセットしてください"
    DeviceBusy = 109 Error Operator "the press controller has been busy for too long (exception 05 or 06)" "look at the controller's load, then reset"
        "プレスの制御装置が長時間ビジーです (例外 05/06)" "制御装置の負荷を確認し、リセットしてください"
    GatewayFailure = 110 Warning Engineer "the gateway does not reach the press (exception 0A or 0B)" "check the serial line behind the gateway and the unit id"
        "ゲートウェイがプレスに接続できません (例外 0A/0B)" "ゲートウェイ先のシリアル回線と unit を確認してください"
    WriteRefused = 111 Error Engineer "a write outside the allowed registers was refused" "correct [press.write] or [press.map]; nothing was written"
        "許可範囲外への書き込みを拒否しました" "[press.write] または [press.map] を修正してください。書き込みは行われていません"
    MissedStroke = 120 Warning Operator "a stroke was not measured: it came while another was, or unseen" "wait for ready before each stroke; reset to clear the count"
        "測定されなかったストロークがあります" "ready を待ってからプレスしてください。リセットで回数を消去します"
    CounterBack = 121 Warning Engineer "the stroke number went back within a session" "change session_id when the counter is set back"
        "同一セッション内でストローク番号が戻りました" "番号を戻すときは session_id を変更してください"
    AckTimeout = 122 Warning Engineer "the press did not acknowledge the result" "check the press program; the next stroke counts as acknowledge"
        "プレスが結果を確認しませんでした" "プレスのプログラムを確認してください。次のストロークが確認とみなされます"
    ScannerNotReady = 201 Error Operator "the scanner is not ready" "look at the scanner: power, door, network"
        "スキャナが準備できていません" "スキャナの電源、扉、ネットワークを確認してください"
    ScanTimeout = 202 Error Operator "the scan took too long" "look at the scanner; raise press.timeouts.scan_ms if the scan is meant to be longer"
        "スキャンが時間内に終わりませんでした" "スキャナを確認し、必要なら press.timeouts.scan_ms を延ばしてください"
    ScanFailed = 203 Error Operator "the scanner reported a failure" "the log has the scanner's own words; repeat the scan"
        "スキャナが異常を返しました" "ログでスキャナの内容を確認し、再スキャンしてください"
    ScanAborted = 204 Error Operator "the press gave the scan up" "request a rescan if the result is needed"
        "プレスがスキャンを中止しました" "結果が必要なら再スキャンを要求してください"
    PressDisabled = 205 Error Operator "the press switched measuring off during the scan" "hold enable until scan_done; request a rescan"
        "スキャン中に測定が無効にされました" "scan_done まで enable を保持し、再スキャンを要求してください"
    NotClear = 206 Error Operator "the press was no longer clear during the scan" "keep ram and plate at rest until scan_done; request a rescan"
        "スキャン中に clear_to_scan が落ちました" "scan_done までラムと板を動かさず、再スキャンを要求してください"
    CalibrationInvalid = 207 Error Operator "the calibration of the scanner is not valid" "run platen calibrate"
        "スキャナの校正が無効です" "platen calibrate を実行してください"
    Interrupted = 208 Error Operator "the host was restarted during the scan" "request a rescan if the result is needed"
        "スキャン中にホストが再起動しました" "結果が必要なら再スキャンを要求してください"
    EvaluationFailed = 301 Error Operator "the scan could not be evaluated" "the log says at which step; look at the scan with platen inspect"
        "スキャンを評価できませんでした" "ログで失敗した処理を確認し、platen inspect でスキャンを調べてください"
    EvaluationTimeout = 302 Error Operator "the evaluation took too long" "raise press.timeouts.evaluate_ms or look for load on the computer"
        "評価が時間内に終わりませんでした" "press.timeouts.evaluate_ms を延ばすか、計算機の負荷を確認してください"
    PlateNotFound = 303 Error Operator "no plate of this size in the scan" "check that the plate lies in the region of interest and that the recipe is right"
        "スキャン内に該当する板がありません" "板が測定領域内にあるか、レシピが正しいか確認してください"
    CoverageLow = 304 Error Operator "too little of the plate was seen" "clear what stands between scanner and plate, then rescan"
        "板の測定範囲が不足しています" "スキャナと板の間の障害物を除き、再スキャンしてください"
    RecipeUnknown = 305 Error Operator "no plate file for the recipe of the press" "add plate-NNN.toml for this recipe number or correct the recipe"
        "プレスのレシピに対応する板ファイルがありません" "このレシピ番号の plate-NNN.toml を追加するか、レシピを修正してください"
    Saturated = 306 Warning Engineer "a figure is larger than its register can hold" "read the full figure in the history; look for the wrong plate or recipe"
        "値がレジスタの範囲を超えました" "履歴で実際の値を確認し、板とレシピを確認してください"
    PlateTurned = 307 Error Operator "the plate lies turned against the stroke before" "turn it back, or let the press send plate_rot; end the part when it is another plate"
        "板が前回のストロークと異なる向きに置かれています" "板の向きを戻すか、プレスから plate_rot を送ってください。別の板なら部品終了を送ってください"
    PluginRestarted = 310 Warning Engineer "a plugin failed and was started again" "nothing if rare; else the log has its last words for its author"
        "プラグインが異常終了し、再起動しました" "まれなら不要。頻発するならログの内容を開発元へ知らせてください"
    PluginOutOfUse = 311 Error Operator "a plugin failed too often and is out of use" "install another version of it, or run platen plugins quarantine clear; platen status names it"
        "プラグインの異常が多く、使用を停止しました" "別の版を入れるか、platen plugins quarantine clear を実行してください。platen status に名前が出ます"
    StorageFailed = 401 Error Operator "the journal cannot be written" "make room on the disk or repair it, then reset"
        "記録を書き込めません" "ディスクの空きを確保するか修理し、リセットしてください"
    StorageDegraded = 402 Warning Operator "results go to the press but are not being recorded" "make room on the disk or repair it"
        "結果はプレスに送られますが記録されていません" "ディスクの空きを確保するか修理してください"
    SinkBehind = 410 Warning Engineer "a sink has been without new strokes for more than an hour" "look at platen status, then at the server, its disk and the network; nothing is lost"
        "送信先が1時間以上遅れています" "platen status と送信先のサーバ、ディスク、ネットワークを確認してください。データは失われません"
    SinkApart = 411 Warning Engineer "a sink has strokes of another record under this press's name" "give each press a name of its own in [forward]; platen status says which sink"
        "送信先に同じプレス名の別の記録があります" "[forward] の press をプレスごとに別の名前にしてください。platen status に送信先が出ます"
    MapVersion = 501 Error Operator "the press has another version of the register map" "update the press program or press.map.in.map_version"
        "プレスのレジスタマップの版が違います" "プレスのプログラムまたは press.map.in.map_version を更新してください"
    PressId = 502 Error Operator "this is another press than the plant file says" "correct host, unit or press_id in the plant file"
        "プラントファイルと違うプレスに接続されています" "プラントファイルの host、unit、press_id を修正してください"
    ClockUnsynchronised = 503 Warning Engineer "the clock of the host has not been synchronised for an hour" "start chrony or systemd-timesyncd, and look whether it reaches its server"
        "ホストの時計が 1 時間以上同期していません" "chrony または systemd-timesyncd を起動し、時刻サーバに接続できるか確認してください"
}

impl Code {
    /// Returns the number in the registers.
    pub fn number(self) -> u16 {
        self as u16
    }
}

impl From<Code> for u16 {
    fn from(code: Code) -> Self {
        code.number()
    }
}

impl TryFrom<u16> for Code {
    type Error = String;

    fn try_from(number: u16) -> Result<Self, String> {
        let found = Self::ALL.iter().copied().find(|code| code.number() == number);
        found.ok_or_else(|| format!("no alarm has the code {number}"))
    }
}

impl std::fmt::Display for Code {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.number(), self.alarm().text(Language::En))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_rise_and_come_back() {
        assert!(Code::ALL.is_sorted_by(|a, b| a.number() < b.number()));
        for &code in Code::ALL {
            assert_eq!(Code::try_from(code.number()), Ok(code));
        }
        assert!(Code::try_from(0).is_err());
    }
}
