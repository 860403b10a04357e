//! Scratch
use dynamics::lattice::Rim;
use dynamics::solve::*;
use dynamics::springs::*;
use dynamics::study::*;
use std::time::Instant;
struct Sys<'a, T>(&'a StepMatrix<T>, &'a mut SampleMultigrid<T>);
impl<T: bspline::Real> System<T> for Sys<'_, T> {
    fn apply(&mut self, p: &[T], q: &mut [T]) -> f64 { self.0.apply(p, q); p.iter().zip(q.iter()).map(|(a, b)| a.as_f64() * b.as_f64()).sum() }
    fn precondition(&mut self, r: &[T], z: &mut [T]) { self.1.apply(self.0, r, z) }
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let m: usize = args[1].parse().unwrap();
    let contrast: f64 = args[2].parse().unwrap();
    let _ = Rim::Free;
    for pattern in std::iter::once(Pattern::Uniform).chain(Pattern::PAINTED) {
        let dt2 = 900.0 * 4.0 / (12.0 * if pattern == Pattern::Uniform { 1.0 } else { contrast });
        let s64 = StepMatrix::new([m; 3], Weights::Constant(1.0), spring_weights(pattern, contrast, m, Neighbours::Six, dt2));
        let s32: StepMatrix<f32> = s64.convert();
        let mut g64 = SampleMultigrid::new([m; 3]);
        let mut g32 = SampleMultigrid::new([m; 3]);
        let t = Instant::now();
        g64.prepare(&s64).unwrap();
        g32.prepare(&s32).unwrap();
        let tp = t.elapsed().as_secs_f64() * 500.0;
        let mut cg = ConjugateGradients::new(m * m * m);
        let mut cg32 = ConjugateGradients::new(m * m * m);
        let mut worst = [0.0f64; 9];
        let mut rr = 0.0f64;
        for g in loads(m) {
            let mut x = g.clone();
            let rep = cg.solve(&mut Sys(&s64, &mut g64), &g, &mut x, 80, 1e-12);
            rr = rr.max(rep.residual);
            let g3: Vec<f32> = g.iter().map(|&v| v as f32).collect();
            let mut y = g3.clone();
            for cap in [1usize, 2, 3, 4, 6, 8] {
                cg32.solve(&mut Sys(&s32, &mut g32), &g3, &mut y, cap, 0.0);
                let num: f64 = y.iter().zip(&x).map(|(a, b)| (*a as f64 - b).powi(2)).sum();
                let den: f64 = x.iter().map(|b| b * b).sum();
                worst[cap] = worst[cap].max((num / den).sqrt());
            }
        }
        let b: Vec<f32> = loads(m)[0].iter().map(|&v| v as f32).collect();
        let mut z = b.clone();
        let t = Instant::now();
        for _ in 0..10 { g32.apply(&s32, &b, &mut z); }
        print!("{:10} prep {tp:.1} V {:.3} ms ref {rr:.0e}", pattern.name(), t.elapsed().as_secs_f64() * 100.0);
        for cap in [1, 2, 3, 4, 6, 8] { print!(" {:.1e}", worst[cap]); }
        println!();
    }
}
