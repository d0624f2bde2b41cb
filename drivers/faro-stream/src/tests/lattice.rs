//! Tests of columns in every direction and value type, and of invalid payloads.

use proptest::prelude::*;

use super::bridge::*;
use crate::column::Layout;

#[test]
fn every_direction_and_value_type_gives_the_same_cells() {
    for azimuth_step in [-0.01, 0.01] {
        for elevation_step in [-0.02, 0.02] {
            for polar in [false, true] {
                let bridge = Bridge { azimuth_step, elevation_step, polar, ..BRIDGE };
                let got = run(&bridge, |_, frames| frames.into_iter().map(Some).collect()).unwrap();
                check(&bridge, &got);
                assert_eq!(got.connections, 1);
                assert!(got.lattice.header().notes.contains(&"rate lowered".to_owned()));
            }
        }
    }
}

#[test]
fn no_lattice_that_a_scanner_cannot_have_is_begun() {
    let sound = BRIDGE.begin();
    assert!(Layout::new(serde_json::from_value(sound.clone()).unwrap()).is_ok());
    for (member, value) in [
        ("rows", 0.into()),
        ("columns", 4_000_000_000_u32.into()),
        ("azimuth_step", 0.0.into()),
        ("elevation_start", 1e9.into()),
        ("range_unit_m", (-1.0).into()),
        ("intensity", serde_json::json!([5, 4])),
        ("seam_column", 13.into()),
    ] {
        let mut begin = sound.clone();
        begin[member] = value;
        assert!(Layout::new(serde_json::from_value(begin).unwrap()).is_err(), "{member}");
    }
}

fn layout() -> Layout {
    Layout::new(serde_json::from_value(BRIDGE.begin()).unwrap()).unwrap()
}

#[test]
fn a_column_that_does_not_keep_to_its_bitmap_is_refused() {
    let whole = BRIDGE.column(3);
    assert!(layout().column(&whole).is_ok());
    for length in 0..whole.len() {
        assert!(layout().column(&whole[..length]).is_err(), "cut at {length}");
    }
    let changed = |at: usize, byte: u8| {
        let mut payload = whole.clone();
        payload[at] = byte;
        layout().column(&payload).unwrap_err().to_string()
    };
    assert!(changed(0, 13).contains("outside the lattice"));
    assert!(changed(4, 3).contains("outside the lattice"));
    assert!(changed(8, 200).contains("outside the lattice"));
    assert!(changed(12, 2).contains("outside the lattice"));
    assert!(changed(26, whole[26] | 1).contains("that do not match its bitmap"));
    let no_range = [&whole[..27], &[0; 4], &whole[31..]].concat();
    assert!(layout().column(&no_range).unwrap_err().to_string().contains("range of 0"));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_payload_is_borne(
        mut payload in prop::collection::vec(any::<u8>(), 0..300),
        edit in any::<prop::sample::Index>(),
        small in prop::collection::vec(0_u32..30, 4),
    ) {
        let _ = layout().column(&payload);
        for (slot, number) in payload.chunks_exact_mut(4).zip(small) {
            slot.copy_from_slice(&number.to_le_bytes());
        }
        let _ = layout().column(&payload);
        let mut close = BRIDGE.column(4);
        let at = edit.index(close.len());
        close[at] = close[at].wrapping_add(1);
        if let Ok((_, column)) = layout().column(&close) {
            prop_assert!(column.check(BRIDGE.rows).is_ok());
        }
    }
}
