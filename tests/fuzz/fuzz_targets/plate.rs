//! Fuzz target of the plate file: any text gives a plate or faults with their places.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    platen_fuzz::within(data.len(), || {
        if let Err(faults) = platen_plant::PlateFile::parse("fuzz.toml", &String::from_utf8_lossy(data)) {
            assert!(faults.to_string().starts_with("fuzz.toml"), "{faults}");
        }
    });
});
