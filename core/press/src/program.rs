//! Reference program of the press in Structured Text (IEC 61131-3), generated from the register map in force.

use platen_plant::press::{Input, Output, Press, Profile};

/// Returns the program for the map: P is the block of the press, H that of the host.
pub fn reference_program(press: &Press) -> String {
    let map = &press.map;
    if map.profile != Profile::Pph1 {
        let ack = if map.inputs.contains_key(&Input::Ack) {
            "IF waiting AND valid THEN (* copy values, judge *) waiting := FALSE; P.ack := TRUE; END_IF;\n\
             IF P.ack AND NOT H.status_result_valid THEN P.ack := FALSE; END_IF;\n"
        } else {
            "IF waiting AND valid THEN (* copy values, judge *) waiting := FALSE; END_IF;\n"
        };
        let ready = if map.outputs.contains_key(&Output::StatusReady) {
            "; press only while H.status_ready"
        } else {
            ""
        };
        return format!(
            "VAR stroke_done, waiting, accepted, valid, alarm : BOOL; tRes : TON; END_VAR\n\
             (* stroke_done: one cycle, ram up after a stroke{ready} *)\n\
             IF stroke_done AND NOT waiting THEN waiting := TRUE; tRes(IN := FALSE); END_IF;\n\
             accepted := waiting AND (accepted OR H.status_busy);\n\
             valid := accepted AND H.status_result_valid AND NOT H.status_busy;\n{ack}\
             P.trigger := waiting;\n\
             tRes(IN := waiting, PT := T#180s);  (* longer than the scan and evaluation limits together *)\n\
             IF tRes.Q THEN waiting := FALSE; alarm := TRUE; END_IF;  (* go on without a measurement *)\n\
             IF NOT waiting THEN accepted := FALSE; END_IF;\n"
        );
    }
    let has = |output| map.outputs.contains_key(&output);
    let tail =
        if map.inputs.contains_key(&Input::StrokeIdTail) { "P.stroke_id_tail := stroke_id; " } else { "" };
    let session =
        if has(Output::SessionEcho) { "\n            AND (H.session_echo = P.session_id)" } else { "" };
    let seq =
        if has(Output::ResultSeqTail) { "\n         AND (H.result_seq = H.result_seq_tail)" } else { "" };
    let simulated = if has(Output::StatusSimulated) { " AND NOT H.status_simulated" } else { "" };
    let wrap = map.counter;
    let standing = standing(press);
    format!(
        "VAR first_cycle, ram_up, stroke_done, waiting, accepted, valid, hostAlive, alarm : BOOL;\n    \
             stroke_id, lastBeat : UINT; tBeat, tAlive, tAcc, tRes : TON; END_VAR\n{standing}\
         (* stroke_done: one cycle, ram up after a stroke; press only while H.status_ready *)\n\
         IF stroke_done AND NOT waiting THEN\n  \
           IF stroke_id >= {} THEN stroke_id := {}; ELSE stroke_id := stroke_id + 1; END_IF;\n  \
           {tail}P.stroke_id := stroke_id; waiting := TRUE; tAcc(IN := FALSE); tRes(IN := FALSE);\n\
         END_IF;\n\
         accepted := waiting AND (H.ack_stroke_id = stroke_id){session};\n\
         P.trigger := waiting AND NOT accepted;\n\
         tAlive(IN := H.heartbeat = lastBeat, PT := T#2s); lastBeat := H.heartbeat; hostAlive := NOT tAlive.Q;\n\
         tAcc(IN := waiting AND NOT accepted, PT := T#500ms);  (* alarm only: the host may be busy *)\n\
         tRes(IN := waiting, PT := T#180s);  (* longer than the scan and evaluation limits together *)\n\
         valid := accepted AND H.status_result_valid AND (H.result_stroke_id = stroke_id){seq}\n         \
           AND hostAlive{simulated};\n\
         IF valid THEN (* copy values, judge *) waiting := FALSE; P.ack := TRUE; END_IF;\n\
         IF P.ack AND NOT H.status_result_valid THEN P.ack := FALSE; END_IF;\n\
         IF waiting AND (tRes.Q OR NOT hostAlive) THEN waiting := FALSE; alarm := TRUE; END_IF;\n\
         (* then the stroke goes on without a measurement: the plant decides *)\n",
        wrap.wrap, wrap.first
    )
}

/// Returns the assignments that hold at all times, for the fields of the map.
fn standing(press: &Press) -> String {
    let mut text = String::from("IF first_cycle THEN");
    let has = |input: &Input| press.map.inputs.get(input).filter(|field| field.place.offset().is_some());
    if let Some(version) = has(&Input::MapVersion).and_then(|field| field.expect) {
        text += &format!(" P.map_version := {version};");
    }
    if has(&Input::PressId).is_some() {
        text += &format!(" P.press_id := {};", press.press_id);
    }
    if has(&Input::SessionId).is_some() {
        text += " P.session_id := random number, not 0;";
    }
    text += " END_IF;\n";
    if has(&Input::Heartbeat).is_some() {
        text += "tBeat(IN := NOT tBeat.Q, PT := T#250ms); IF tBeat.Q THEN P.heartbeat := P.heartbeat + 1; END_IF;\n";
    }
    if has(&Input::Enable).is_some() {
        text += "P.enable := TRUE;  (* while strokes are to be measured *)\n";
    }
    if has(&Input::ClearToScan).is_some() {
        text += "P.clear_to_scan := ram_up;  (* and the plate at rest *)\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use platen_plant::press::{Link, RegisterMap};

    #[test]
    fn the_program_asks_only_for_what_the_press_has() {
        let mut press = Press::pph1("Press 3", 3, Link::tcp("192.0.2.10", 502, 1));
        assert!(reference_program(&press).contains("H.session_echo = P.session_id"));
        press.map.outputs.remove(&Output::SessionEcho);
        press.map.inputs.remove(&Input::SessionId);
        assert!(!reference_program(&press).contains("session"));
        assert!(reference_program(&press).contains("P.map_version := 1; P.press_id := 3; END_IF;"));
        press.map = RegisterMap::word();
        let program = reference_program(&press);
        assert!(!program.contains("stroke_id") && !program.contains("P.ack"), "{program}");
        assert!(!program.contains("status_ready"), "{program}");
        press.map = RegisterMap::bits();
        assert!(reference_program(&press).contains("H.status_ready"));
    }
}
