//! What a picture costs: processor time and memory, where the system tells (Linux).

use std::fs;

/// Ticks per second of the times in `/proc`: 100 on every Linux since 2.6 (USER_HZ).
const TICKS: f64 = 100.0;

/// Returns the processor time of this process, all threads, user and system \[s\].
pub fn cpu_seconds() -> Option<f64> {
    let text = fs::read_to_string("/proc/self/stat").ok()?;
    // The name in parentheses may hold anything; the fields behind it are numbers, the 12th and 13th these times.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |i: usize| fields.get(i)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / TICKS)
}

/// Starts to measure the peak of memory anew; returns whether the system can.
pub fn reset_peak() -> bool {
    fs::write("/proc/self/clear_refs", "5").is_ok()
}

/// Returns the peak of memory in use since the last reset, or since the start \[bytes\].
pub fn peak_bytes() -> Option<u64> {
    let text = fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok().map(|k| 1024 * k)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn time_and_memory_grow_with_use() {
        let before = cpu_seconds().expect("Linux");
        let block = vec![1u8; 64 << 20];
        let sum: u64 = (0..4).map(|_| block.iter().map(|&b| u64::from(std::hint::black_box(b))).sum::<u64>()).sum();
        assert_eq!(sum, 4 << 26);
        assert!(cpu_seconds().expect("Linux") >= before && peak_bytes().expect("Linux") > 64 << 20);
    }
}
