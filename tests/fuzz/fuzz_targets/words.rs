//! Fuzz target of the press's registers: any words in any map give an image, or a torn read.
#![no_main]

use platen_plant::PlantFile;
use platen_plant::press::Press;
use platen_press::{PressImage, describe_inputs};
use std::sync::LazyLock;

static PRESSES: LazyLock<Vec<Press>> = LazyLock::new(|| {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config");
    let files = std::fs::read_dir(folder).expect("config").flatten().map(|entry| entry.path());
    let mut files: Vec<_> = files.filter(|path| path.to_string_lossy().contains("/plant-")).collect();
    files.sort();
    files.iter().filter_map(|path| PlantFile::load(path).expect("a sound plant file").press).collect()
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let [which, count, rest @ ..] = data else { return };
    let press = &PRESSES[usize::from(*which) % PRESSES.len()];
    let words: Vec<u16> = rest.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
    let words = &words[..words.len().min(usize::from(*count))];
    platen_fuzz::within(data.len(), || {
        let _ = PressImage::decode(&press.map, press.press_id, words);
        let _ = describe_inputs(&press.map, words);
    });
});
