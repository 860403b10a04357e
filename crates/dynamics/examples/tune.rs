//! Scratch: increment errors of the V-cycle.
use dynamics::lattice::{Lattice, Rim, TensorWorkspace};
use dynamics::solve::*;
use dynamics::springs::*;
use dynamics::study::*;
use std::time::Instant;

fn explicit_limit(l: &Lattice<f64>, springs: &[SpringWeights<f64>]) -> f64 {
    // unit mass
    let dims = l.sample_dims();
    let k = StepMatrix::new(dims, Weights::Constant(0.0), springs.to_vec());
    let mut fd = FastDiagonalization::new(l);
    fd.set(1.0, [0.0; 3]);
    let n = l.coefficient_count();
    let mut w = TensorWorkspace::new();
    let (mut d, mut s) = (vec![0.0; l.sample_count()], vec![0.0; l.sample_count()]);
    let mut v: Vec<f64> = (0..n)
        .map(|i| ((i * 7919) % 1013) as f64 / 1013.0 - 0.5)
        .collect();
    let mut q = vec![0.0; n];
    let mut lambda = 0.0;
    for _ in 0..60 {
        l.sample(&v, &mut d, &mut w);
        let norm: f64 = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.iter_mut().for_each(|x| *x /= norm);
        d.iter_mut().for_each(|x| *x /= norm);
        k.apply(&d, &mut s);
        lambda = d.iter().zip(&s).map(|(a, b)| a * b).sum::<f64>();
        l.gather(&s, &mut q, &mut w);
        fd.apply(&q, &mut v);
    }
    2.0 / lambda.sqrt()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let n: usize = args[1].parse().unwrap();
    let m: usize = args[2].parse().unwrap();
    let rim = if args[3] == "rim" { Rim::Fixed } else { Rim::Free };
    let contrast: f64 = args[4].parse().unwrap();
    let times: f64 = args[5].parse().unwrap();
    let degree: usize = args.get(6).map_or(2, |s| s.parse().unwrap());
    let limit: usize = args.get(7).map_or(1400, |s| s.parse().unwrap());
    let nb = if args.get(8).is_some_and(|s| s == "18") {
        Neighbours::Eighteen
    } else {
        Neighbours::Six
    };
    let l64 = Lattice::<f64>::cube(n, m, rim, 1.0).unwrap();
    let l32 = Lattice::<f32>::cube(n, m, rim, 1.0).unwrap();
    let nc = l64.coefficient_count();
    let steps: Vec<_> = nb.directions().iter().map(|d| d.step).collect();
    let o = VCycleOptions {
        degree,
        direct_limit: limit,
        ..Default::default()
    };
    let mut v32 = VCycle::new(&l32, &steps, o);
    let mut v64 = VCycle::new(&l64, &steps, VCycleOptions { degree: 3, ..o });
    println!(
        "{n}/{m} free {nc} levels {} coarsest {}",
        v32.level_count(),
        v32.coarsest_count()
    );
    let direct = nc <= 4000;
    let mut galerkin = Galerkin::new(&l64, &steps);
    let mut factor = BandCholesky::<f64>::new(
        if direct { nc } else { 1 },
        if direct { galerkin.band() } else { 0 },
    );
    let mut cg32 = ConjugateGradients::new(&l32);
    let mut cg64 = ConjugateGradients::new(&l64);
    let mut w = TensorWorkspace::new();
    let mut w32 = TensorWorkspace::new();
    for pattern in std::iter::once(Pattern::Uniform).chain(Pattern::PAINTED) {
        let base = spring_weights(pattern, contrast, m, nb, 1.0);
        let dt = times * explicit_limit(&l64, &base);
        let s64 = StepMatrix::new(
            l64.sample_dims(),
            Weights::Constant(1.0),
            spring_weights(pattern, contrast, m, nb, dt * dt),
        );
        let s32: StepMatrix<f32> = s64.convert();
        let t = Instant::now();
        v32.prepare(&s32).unwrap();
        let tp = t.elapsed().as_secs_f64() * 1e3;
        if direct {
            galerkin.assemble(&s64, &mut factor);
            factor.factorize().unwrap();
        } else {
            v64.prepare(&s64).unwrap();
        }
        let mut worst = [0.0f64; 9];
        let mut wc = [0.0f64; 9];
        let mut res = [0.0f64; 9];
        let mut refres = 0.0f64;
        for g in loads(m) {
            let mut b = vec![0.0; nc];
            l64.gather(&g, &mut b, &mut w);
            let mut x = b.clone();
            let mut dx = g.clone();
            if direct {
                factor.solve(&mut x);
                // one refinement
                l64.sample(&x, &mut dx, &mut w);
                let mut s = dx.clone();
                s64.apply(&dx, &mut s);
                let mut q = b.clone();
                l64.gather(&s, &mut q, &mut w);
                let mut r: Vec<f64> = b.iter().zip(&q).map(|(b, q)| b - q).collect();
                let rn: f64 =
                    r.iter().map(|v| v * v).sum::<f64>().sqrt() / b.iter().map(|v| v * v).sum::<f64>().sqrt();
                refres = refres.max(rn);
                factor.solve(&mut r);
                x.iter_mut().zip(&r).for_each(|(x, r)| *x += r);
                l64.sample(&x, &mut dx, &mut w);
            } else {
                let rep = cg64.solve(&l64, &s64, &mut v64, &b, &mut x, &mut dx, 80, 1e-11);
                refres = refres.max(rep.residual);
            }
            let g32: Vec<f32> = g.iter().map(|&v| v as f32).collect();
            let mut b32 = vec![0f32; nc];
            l32.gather(&g32, &mut b32, &mut w32);
            let (mut x32, mut d32) = (b32.clone(), g32.clone());
            for cap in [1usize, 2, 3, 4, 6, 8] {
                let rep = cg32.solve(&l32, &s32, &mut v32, &b32, &mut x32, &mut d32, cap, 0.0);
                let e = |a: &[f32], b: &[f64]| {
                    let num: f64 = a.iter().zip(b).map(|(a, b)| (*a as f64 - b).powi(2)).sum();
                    let den: f64 = b.iter().map(|b| b * b).sum();
                    (num / den).sqrt()
                };
                worst[cap] = worst[cap].max(e(&d32, &dx));
                wc[cap] = wc[cap].max(e(&x32, &x));
                res[cap] = res[cap].max(rep.residual);
            }
        }
        let b32: Vec<f32> = (0..nc).map(|i| (i % 17) as f32).collect();
        let mut z = b32.clone();
        let t = Instant::now();
        for _ in 0..20 {
            v32.apply(&s32, &b32, &mut z);
        }
        let tv = t.elapsed().as_secs_f64() * 50.0;
        print!(
            "{:10} prep {tp:6.1} ms V {tv:.3} ms ref {refres:.0e} l {:?} ",
            pattern.name(),
            v32.eigenvalues()
                .map(|v| (v * 10.0).round() / 10.0)
                .collect::<Vec<_>>()
        );
        for cap in [1, 2, 3, 4, 6, 8] {
            print!(" {:.1e}", worst[cap]);
        }
        println!("  coef@8 {:.1e} res@8 {:.1e}", wc[8], res[8]);
    }
}
