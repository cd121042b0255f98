#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    moonmilk_io::fuzz::exr(data);
});
