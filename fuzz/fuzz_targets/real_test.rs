#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    btr_fuzz::targets::runs::real_test(data);
});
