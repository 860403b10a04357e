//! `isoclay render --turntable`: a solid from all sides.

use crate::common::{Bench, number};

#[test]
fn turned_pictures_have_one_scale_and_appear_together() {
    let bench = Bench::new();
    bench.json("phantom torus -o cloud.ply --count 4000");
    bench.json("fit cloud.ply -o field.iclay");
    let told = bench.json("render field.iclay -o turns --turntable 4 --size 64x48");
    assert_eq!(told["output"], "turns");
    assert!(number(&told, "triangles") > 100.0);
    let names = |directory: &str| {
        let files = std::fs::read_dir(bench.path(directory)).unwrap();
        let mut names: Vec<String> = files
            .map(|f| f.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    };
    assert_eq!(names("turns"), ["0000.png", "0001.png", "0002.png", "0003.png"]);
    let picture = |n: usize| {
        let file = std::fs::File::open(bench.path(&format!("turns/000{n}.png"))).unwrap();
        let mut reader = png::Decoder::new(std::io::BufReader::new(file))
            .read_info()
            .unwrap();
        assert_eq!((reader.info().width, reader.info().height), (64, 48));
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    };
    // Columns that show anything but paper, which is as bright as its left edge.
    let width = |pixels: &[u8]| {
        let is_solid = |x: usize| (0..48).any(|y| pixels[3 * (64 * y + x)].abs_diff(pixels[3 * 64 * y]) > 40);
        (0..64).filter(|x| is_solid(*x)).count()
    };
    let widths = [0, 1, 2, 3].map(|n| width(&picture(n)));
    assert!(
        widths[0].abs_diff(widths[2]) <= 1 && widths[1].abs_diff(widths[3]) <= 1,
        "{widths:?}"
    );
    assert!(picture(0) != picture(1));
    let wrong = bench.run("render field.iclay -o turns --turntable 4 --errors errors.png");
    assert_eq!(wrong.code, 2);
}
