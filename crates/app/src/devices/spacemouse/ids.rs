//! Which devices of 3Dconnexion have a cap with six axes.

use crate::devices::transport::Identity;

/// Makers: 3Dconnexion, and Logitech before.
const MAKERS: [u16; 2] = [0x256f, 0x046d];

/// Page and usage of such a device: generic desktop, multi-axis controller.
pub const MULTI_AXIS: (u16, u16) = (0x01, 0x08);

/// Known ones.
const KNOWN: &[(u16, u16, &str)] = &[
    (0x046d, 0xc603, "SpaceMouse Plus XT"),
    (0x046d, 0xc605, "CadMan"),
    (0x046d, 0xc606, "SpaceMouse Classic"),
    (0x046d, 0xc621, "Spaceball 5000"),
    (0x046d, 0xc623, "SpaceTraveler"),
    (0x046d, 0xc625, "SpacePilot"),
    (0x046d, 0xc626, "SpaceNavigator"),
    (0x046d, 0xc627, "SpaceExplorer"),
    (0x046d, 0xc628, "SpaceNavigator for Notebooks"),
    (0x046d, 0xc629, "SpacePilot Pro"),
    (0x046d, 0xc62b, "SpaceMouse Pro"),
    (0x256f, 0xc62e, "SpaceMouse Wireless (cable)"),
    (0x256f, 0xc62f, "SpaceMouse Wireless (receiver)"),
    (0x256f, 0xc631, "SpaceMouse Pro Wireless (cable)"),
    (0x256f, 0xc632, "SpaceMouse Pro Wireless (receiver)"),
    (0x256f, 0xc633, "SpaceMouse Enterprise"),
    (0x256f, 0xc635, "SpaceMouse Compact"),
    (0x256f, 0xc636, "SpaceMouse Module"),
    (0x256f, 0xc638, "SpaceMouse Pro Wireless BT"),
    (0x256f, 0xc63a, "SpaceMouse Wireless BT"),
    (0x256f, 0xc652, "Universal Receiver"),
];

/// Mice and keyboards of 3Dconnexion, whatever their descriptors promise.
const NEVER: [u16; 11] = [
    0xc650, 0xc651, 0xc654, 0xc655, 0xc656, 0xc657, 0xc658, 0xc664, 0xc665, 0xc668, 0xc62c,
];

/// The name of a device with a cap, None of any other. The descriptor decides: of one that is not in the table yet too, and
/// against the table where the device is a receiver with a mouse on it.
pub fn recognize(identity: &Identity) -> Option<&str> {
    let is_ours = MAKERS.contains(&identity.vendor) && identity.has(MULTI_AXIS.0, MULTI_AXIS.1);
    let is_never = identity.vendor == 0x256f && NEVER.contains(&identity.product);
    if !is_ours || is_never || identity.name.ends_with("Universal Receiver Mouse") {
        return None;
    }
    let known = KNOWN
        .iter()
        .find(|(vendor, product, _)| (*vendor, *product) == (identity.vendor, identity.product));
    match known {
        Some((_, _, name)) => Some(name),
        // Logitech makes much else.
        None if identity.vendor == 0x256f => Some("SpaceMouse"),
        None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(vendor: u16, product: u16, usage: (u16, u16)) -> Identity {
        Identity {
            vendor,
            product,
            usages: vec![usage],
            ..Identity::default()
        }
    }

    #[test]
    fn the_descriptor_decides_and_never_the_id_alone() {
        for (vendor, product, name) in KNOWN {
            let with_cap = identity(*vendor, *product, MULTI_AXIS);
            assert_eq!(recognize(&with_cap), Some(*name));
            assert_eq!(
                recognize(&identity(*vendor, *product, (0x01, 0x02))),
                None,
                "{name}"
            );
        }
        assert_eq!(
            recognize(&identity(0x256f, 0xc641, MULTI_AXIS)),
            Some("SpaceMouse")
        );
        assert_eq!(recognize(&identity(0x256f, 0xc641, (0x01, 0x06))), None);
        assert_eq!(recognize(&identity(0x046d, 0xc216, MULTI_AXIS)), None);
        assert_eq!(recognize(&identity(0x1234, 0xc635, MULTI_AXIS)), None);
    }

    #[test]
    fn mice_and_keyboards_are_left_alone() {
        for product in NEVER {
            assert_eq!(
                recognize(&identity(0x256f, product, MULTI_AXIS)),
                None,
                "{product:04x}"
            );
        }
        let mouse = Identity {
            name: "3Dconnexion Universal Receiver Mouse".into(),
            ..identity(0x256f, 0xc652, MULTI_AXIS)
        };
        assert_eq!(recognize(&mouse), None);
    }
}
