//! Fuzz target of the plant file: any text gives a plant or faults with their places.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    platen_fuzz::within(data.len(), || {
        if let Err(faults) = platen_plant::PlantFile::parse("fuzz.toml", &String::from_utf8_lossy(data)) {
            assert!(faults.to_string().starts_with("fuzz.toml"), "{faults}");
        }
    });
});
