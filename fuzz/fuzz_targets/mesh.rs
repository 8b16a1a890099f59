#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    btr_fuzz::targets::models::mesh(data);
});
