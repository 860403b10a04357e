//! EXPERIMENT

use bspline::Real;

use super::active::ActiveSet;
use super::detail::{DetailLayout, interpolation, least_squares};
use super::domain::{Domain, Samples};
use super::joint::{Fit, solve_jointly};
use super::residual::{correlations, residual};
use super::select::{Cutoff, largest};
use crate::{Control, FitError};

fn env(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

fn rms<T: Real>(r: &[T]) -> f64 {
    (r.iter().map(|&v| v.to_f64() * v.to_f64()).sum::<f64>() / r.len() as f64).sqrt()
}

/// EXPERIMENT
pub fn experiment<T: Real>(dims: [usize; 3], values: &[f32], count: usize) -> Result<(), FitError> {
    let control = &mut Control::default();
    let t0 = cpu();
    let lap = |what: &str| eprintln!("  {:7.3} s  {what}", cpu() - t0);
    let domain = Domain::<T>::new(dims, 3);
    let samples = Samples { values, dims, scale: T::one() };
    let mut fit = Fit::new(&domain);
    let n: usize = domain.padded().iter().product();
    let mut r = vec![T::zero(); n];
    residual(&domain, &samples, &fit.active, &fit.coefficients, &mut r);
    lap("copy");
    let none = ActiveSet::empty(domain.functions(2));
    let mut corr = correlations(&domain, &r, &none);
    lap("correlations");
    let mut c0 = std::mem::take(&mut corr[0]);
    least_squares(&domain, 0, &mut c0);
    fit.coefficients[0] = c0;
    lap("level 0 lsq");
    residual(&domain, &samples, &fit.active, &fit.coefficients, &mut r);
    lap("residual");
    eprintln!("level 0: {} rms {:.4}", fit.count(), rms(&r));
    let mut corr = correlations(&domain, &r, &none);
    lap("corr");
    let chosen = count - fit.count();
    // level 1
    let l1 = DetailLayout::of_level(&domain, 1);
    let mut c1 = std::mem::take(&mut corr[1]);
    least_squares(&domain, 1, &mut c1);
    let mut s1 = c1.clone();
    l1.score(&domain, &mut s1);
    lap("level 1 detail");
    let mut scratch = r.clone();
    let share = env("SHARE", 0.4);
    let cut1 = if share > 0.0 {
        largest(&[&s1], (share * chosen as f64) as usize)
    } else {
        // one tau: decomposition with full level 1
        let mut full = fit.clone();
        full.active[1] = ActiveSet::full(domain.functions(1));
        full.coefficients[1] = c1.clone();
        residual(&domain, &samples, &full.active, &full.coefficients, &mut scratch);
        eprintln!("level 1 full: rms {:.4}", rms(&scratch));
        interpolation(&domain, &mut scratch);
        DetailLayout::of_level(&domain, 2).score(&domain, &mut scratch);
        // weight of level 1 scores
        let w = T::from_f64(env("W1", 1.0));
        s1.iter_mut().for_each(|s| *s *= w);
        largest(&[&s1, &scratch], chosen)
    };
    fit.set_active(1, l1.select(&domain, &s1, cut1, 0));
    let set = fit.active[1].clone();
    l1.for_each_active(&set, |p, i| fit.coefficients[1][p] = c1[i]);
    lap("level 1 select");
    residual(&domain, &samples, &fit.active, &fit.coefficients, &mut r);
    eprintln!("level 1: {} rms {:.4}", fit.count(), rms(&r));
    let its = env("IT1", 5.0) as usize;
    solve_jointly(&domain, &samples, &mut fit, &mut r, its, control, ("", 0.0, 1.0))?;
    eprintln!("joint 1: {} rms {:.4}", fit.count(), rms(&r));
    lap("joint 1");
    let l2 = DetailLayout::of_level(&domain, 2);
    scratch.copy_from_slice(&r);
    interpolation(&domain, &mut scratch);
    lap("prefilter");
    let c2 = scratch.clone();
    l2.score(&domain, &mut scratch);
    let cut2 = largest(&[&scratch], count - fit.count());
    lap("largest");
    fit.set_active(2, l2.select(&domain, &scratch, cut2, 0));
    lap("select");
    if env("INIT2", 1.0) > 0.0 {
        let set = fit.active[2].clone();
        l2.for_each_active(&set, |p, i| fit.coefficients[2][p] = c2[i]);
        residual(&domain, &samples, &fit.active, &fit.coefficients, &mut r);
    }
    eprintln!("level 2: {} rms {:.4}", fit.count(), rms(&r));
    let its = env("IT2", 20.0) as usize;
    let t = cpu();
    solve_jointly(&domain, &samples, &mut fit, &mut r, its, control, ("", 0.0, 1.0))?;
    eprintln!("joint: {} rms {:.4}; {:.4} s per it", fit.count(), rms(&r), (cpu() - t) / its as f64);
    lap("joint 2");
    for _ in 0..env("EXCH", 0.0) as usize {
        let corr = correlations(&domain, &r, &none);
        let mut c1 = corr.into_iter().nth(1).unwrap();
        least_squares(&domain, 1, &mut c1);
        // total detail = residual detail for inactive, own coefficient for active
        let own = env("OWN", 1.0);
        let a1 = fit.active[1].clone();
        if own > 0.0 {
            l1.for_each_active(&a1, |p, i| c1[i] = fit.coefficients[1][p]);
        }
        l1.score(&domain, &mut c1);
        let mut c2 = r.clone();
        interpolation(&domain, &mut c2);
        let a2 = fit.active[2].clone();
        l2.for_each_active(&a2, |p, i| c2[i] = fit.coefficients[2][p]);
        l2.score(&domain, &mut c2);
        let w = T::from_f64(env("WX", 1.0));
        c1.iter_mut().for_each(|s| *s *= w);
        // threshold such that 15 % of the active fall below
        let frac = env("FRAC", 0.15);
        let active_total = a1.len() + a2.len();
        let mut act: Vec<(f32, usize)> = Vec::new();
        l1.for_each_active(&a1, |_, i| act.push((c1[i].to_f64() as f32, i)));
        l2.for_each_active(&a2, |_, i| act.push((c2[i].to_f64() as f32, c1.len() + i)));
        let drop = (frac * active_total as f64) as usize;
        let free = largest(&[&c1, &c2], active_total);
        // natural exchange: count of active below the free cutoff
        let natural = act.iter().filter(|(s, i)| !free.keeps(T::from_f64(*s as f64), *i)).count();
        eprintln!("natural exchange {} of {} (limit {drop})", natural, active_total);
        let cut = if natural <= drop { free } else {
            act.select_nth_unstable_by(drop, |a, b| a.0.total_cmp(&b.0));
            // boost actives above the drop line to infinity
            for &(s, i) in &act[drop..] {
                let _ = s;
                if i < c1.len() { c1[i] = T::from_f64(1e30) } else { let j = i - c1.len(); c2[j] = T::from_f64(1e30) }
            }
            for &(_, i) in &act[..drop] {
                if i < c1.len() { c1[i] = T::zero() } else { let j = i - c1.len(); c2[j] = T::zero() }
            }
            largest(&[&c1, &c2], active_total)
        };
        let n1 = c1.len();
        fit.set_active(1, l1.select(&domain, &c1, cut, 0));
        fit.set_active(2, l2.select(&domain, &c2, cut, n1));
        lap("exchange");
        residual(&domain, &samples, &fit.active, &fit.coefficients, &mut r);
        eprintln!("exchanged: {} + {} rms {:.4}", fit.active[1].len(), fit.active[2].len(), rms(&r));
        solve_jointly(&domain, &samples, &mut fit, &mut r, env("IT3", 15.0) as usize, control, ("", 0.0, 1.0))?;
        eprintln!("joint: {} rms {:.4} max {:.2}", fit.count(), rms(&r), r.iter().fold(0.0, |m: f64, &v| m.max(v.to_f64().abs())));
        lap("joint 3");
    }
    let _ = Cutoff::above(0.0);
    eprintln!("share of level 1: {:.3}", fit.active[1].len() as f64 / chosen as f64);
    Ok(())
}

fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/schedstat").unwrap();
    let _ = s;
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}
