//! The methods that scenes are told with: a tool, mm, and a stiffness, N/m.

use tools::haptics::controls::{Penalty, TangentPlane};
use tools::haptics::{Coupling, Proxy, ProxyOptions, Vcp, VcpOptions};

pub fn proxy(radius: f64, stiffness: f64) -> Proxy {
    Proxy::new(ProxyOptions {
        radius,
        coupling: Coupling::spring(stiffness),
        ..ProxyOptions::default()
    })
}

pub fn vcp(radius: f64, stiffness: f64) -> Vcp {
    Vcp::new(VcpOptions {
        radius,
        coupling: Coupling::spring(stiffness),
        ..VcpOptions::default()
    })
}

pub fn penalty(radius: f64, stiffness: f64) -> Penalty {
    Penalty { radius, stiffness }
}

pub fn plane(radius: f64, stiffness: f64, rate: f64) -> TangentPlane {
    TangentPlane::new(radius, stiffness, rate)
}
