//! Reading a scan, beside the copying of its bytes, which nothing can beat.
//!
//! `cargo bench -p spmfile`. Compare rates within one run; absolute ones depend on the machine.

use divan::{Bencher, counter::BytesCount};
use spmfile::{
    Channel, ChannelInfo, DateTime, FrameDirection, LineDirection, Samples, Scan, nanoscope, read,
    read_selected,
};

fn main() {
    divan::main();
}

const SIDE: usize = 512;

/// Four channels, trace and retrace of each, `side` × `side`, as the instrument stores them: 32 bits.
fn file(side: usize) -> Vec<u8> {
    let names = [
        ("TR Phase", "TRPhase"),
        ("TR Amplitude", "TRAmplitude"),
        ("X Sensor", "XSensor"),
        ("Y Sensor", "YSensor"),
    ];
    let lines = [LineDirection::Trace, LineDirection::Retrace];
    let channels = names
        .iter()
        .flat_map(|name| lines.map(|line| channel(*name, line, side)));
    let scan = Scan {
        format: "NanoScope 9.40".to_owned(),
        instrument: None,
        acquired: Some(DateTime {
            year: 2024,
            month: 1,
            day: 15,
            hour: 10,
            minute: 0,
            second: 0,
        }),
        frame_direction: Some(FrameDirection::Up),
        line_rate_hz: Some(8.0),
        rounding: Some(0.05),
        rotation_rad: 0.0,
        offset_nm: [0.0; 2],
        size_nm: Some([70.0; 2]),
        closed_loop: Some(false),
        line_times_s: None,
        notes: Vec::new(),
        metadata: Vec::new(),
        channels: channels.collect(),
        unreadable: Vec::new(),
    };
    nanoscope::write(&scan).expect("a scan that can be written")
}

fn channel((name, internal_name): (&str, &str), line: LineDirection, side: usize) -> Channel {
    // Counts without a pattern; what they are makes no difference to the reader.
    let counts = (0..(side * side) as i32).map(|i| i.wrapping_mul(0x9e37_79b9_u32 as i32) >> 4);
    Channel {
        name: name.to_owned(),
        internal_name: internal_name.to_owned(),
        unit: "nm".to_owned(),
        line_direction: Some(line),
        scan_line: Some("Main".to_owned()),
        rows: side,
        columns: side,
        width_nm: Some(70.0),
        height_nm: Some(70.0),
        span: spmfile::Span::Frame,
        scale: 1e-6,
        offset: 0.0,
        scaling: String::new(),
        plane_fit: None,
        samples: Samples::I32(counts.collect()),
    }
}

#[divan::bench]
fn copy_the_bytes(bencher: Bencher<'_, '_>) {
    let file = file(SIDE);
    bencher
        .counter(BytesCount::new(file.len()))
        .bench(|| divan::black_box(&file).clone());
}

#[divan::bench]
fn read_all_eight_channels(bencher: Bencher<'_, '_>) {
    let file = file(SIDE);
    bencher
        .counter(BytesCount::new(file.len()))
        .bench(|| read(divan::black_box(&file)));
}

/// What an analysis reads: one channel and both sensors, trace and retrace.
#[divan::bench]
fn read_six_of_eight_channels(bencher: Bencher<'_, '_>) {
    let file = file(SIDE);
    bencher.counter(BytesCount::new(file.len())).bench(|| {
        read_selected(divan::black_box(&file), &|channel: &ChannelInfo| {
            channel.name != "TR Amplitude"
        })
    });
}

#[divan::bench]
fn read_the_header_only(bencher: Bencher<'_, '_>) {
    let file = file(SIDE);
    bencher.bench(|| read_selected(divan::black_box(&file), &|_: &ChannelInfo| false));
}

#[divan::bench]
fn counts_to_nanometres(bencher: Bencher<'_, '_>) {
    let scan = read(&file(SIDE)).expect("our own file");
    let channel = &scan.channels[0];
    bencher
        .counter(BytesCount::new(4 * channel.samples.len()))
        .bench(|| divan::black_box(channel).values());
}

/// A large file of another instrument: 4096 × 4096, four quantities forward and backward, single
/// precision from the top, most significant byte first. Reading turns lines and samples around on the way.
fn large() -> Vec<u8> {
    let header = b":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\nFLOAT MSBFIRST\n:SCAN_PIXELS:\n4096 4096\n\
                   :SCAN_RANGE:\n1E-7 1E-7\n:SCAN_DIR:\ndown\n:DATA_INFO:\n\
                   \tName\tUnit\tDirection\n\tZ\tm\tboth\n\tCurrent\tA\tboth\n\tPhase\tdeg\tboth\n\
                   \tAmplitude\tm\tboth\n:SCANIT_END:\n\n\n\x1a\x04";
    let samples = (0..8 * 4096 * 4096).flat_map(|n: u32| (n as f32).to_be_bytes());
    header.iter().copied().chain(samples).collect()
}

/// What reading is measured by: its bytes copied once and converted once.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn large_copied_and_converted(bencher: Bencher<'_, '_>) {
    let file = large();
    bencher.counter(BytesCount::new(file.len())).bench(|| {
        let bytes = divan::black_box(&file).clone();
        let (samples, _) = bytes.as_chunks::<4>();
        let channels = samples.chunks(4096 * 4096);
        let convert = |channel: &[[u8; 4]]| -> Vec<f32> {
            channel.iter().map(|&b| f32::from_be_bytes(b)).collect()
        };
        channels.map(convert).collect::<Vec<_>>()
    });
}

/// The same with our reader, from bytes that were copied as they would be from a disk.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn large_copied_and_read(bencher: Bencher<'_, '_>) {
    let file = large();
    bencher
        .counter(BytesCount::new(file.len()))
        .bench(|| read(&divan::black_box(&file).clone()));
}

/// One of its eight channels.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn large_one_channel(bencher: Bencher<'_, '_>) {
    let file = large();
    bencher.counter(BytesCount::new(file.len())).bench(|| {
        read_selected(divan::black_box(&file), &|channel: &ChannelInfo| {
            channel.name == "Phase" && channel.line_direction == Some(LineDirection::Trace)
        })
    });
}

/// The eight channels of [`file`] with 4096 × 4096 counts of 32 bits each, copied and converted once.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn large_counts_copied_and_converted(bencher: Bencher<'_, '_>) {
    let file = file(4096);
    bencher.counter(BytesCount::new(file.len())).bench(|| {
        let bytes = divan::black_box(&file).clone();
        let (samples, _) = bytes.as_chunks::<4>();
        let channels = samples.chunks(4096 * 4096);
        let convert = |channel: &[[u8; 4]]| -> Vec<i32> {
            channel.iter().map(|&b| i32::from_le_bytes(b)).collect()
        };
        channels.map(convert).collect::<Vec<_>>()
    });
}

/// The same with our reader.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn large_counts_copied_and_read(bencher: Bencher<'_, '_>) {
    let file = file(4096);
    bencher
        .counter(BytesCount::new(file.len()))
        .bench(|| read(&divan::black_box(&file).clone()));
}
