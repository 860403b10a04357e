use bspline::{Field, HierarchicalSpline, Real};
use dynamics::lattice::OnBox;
use dynamics::region::Region;
use glam::DVec3;

use super::extent::Extent;
use super::filter::Shape;
use super::ground::Ground;
use super::hand::Hand;
use super::holding::{Drawn, Holding};
use super::report::{Arrival, ForceReport};
use super::row::Functions;
use super::spread::Load;
use super::system::Memory;
use super::target::{Start, Target};
use super::within::within;
use super::{ForceError, How, Rule, Solid, track};
use crate::face::Face;
use crate::paint::Layers;

/// Radii of track that a tool goes on at once. Each time the shape so far becomes the one at rest: what is left behind
/// would else spring back by what its springs have not yet followed.
pub(super) const STAGE: f64 = 6.0;
/// Radii that the goal of the longest path advances in a step.
pub(super) const ADVANCE: f64 = 0.3;
/// Radii that a region leaves a tool in a hand to go on.
const ROAM: f64 = 3.0;

/// Where forces move nothing.
pub(super) const AT_FACE: &str = "within two knot intervals of a face of the field's box, where the solid is cut off and forces move nothing";
/// Cells of the coarsest level beyond a face that a place without room is said to lie.
const BEYOND: f64 = 1e-3;
/// What does.
pub(super) const INSTEAD: &str = "use inflate, push or a move there";

/// A path that acts.
#[derive(Clone, Debug)]
pub(super) struct Acting {
    pub(super) index: usize,
    /// Total force.
    pub(super) force: f64,
    /// How it lay when the stroke began; `None` where it did not meet the surface.
    pub(super) start: Option<Start>,
    /// Arc length of the surface on it, where there is one, now and before the step.
    pub(super) crossing: Option<f64>,
    pub(super) before: Option<f64>,
    /// Steps that it has acted.
    pub(super) age: usize,
    /// How far it goes by a unit of force on all paths, by what they stand for.
    pub(super) stiffness: f64,
    /// What it stands for.
    pub(super) worth: f64,
    /// Whether it begins where limits allow it to act.
    pub(super) is_free: bool,
}

/// A force tool at work on a field.
pub struct ForceStroke<T> {
    /// The field when the stroke began.
    pub(super) origin: HierarchicalSpline<T>,
    /// The field without the changes of the region since it was cut.
    pub(super) field: HierarchicalSpline<T>,
    pub(super) region: Region<T>,
    pub(super) layers: Layers,
    pub(super) holding: Holding,
    /// Constraints of the region.
    pub(super) drawn: Drawn,
    pub(super) iso: f64,
    pub(super) radius: f64,
    pub(super) shape: Shape,
    pub(super) how: How,
    pub(super) gain: f64,
    pub(super) targets: Vec<Target>,
    pub(super) acting: Vec<Acting>,
    /// Targets that have begun.
    pub(super) begun: usize,
    pub(super) extent: Extent,
    /// Where the tool is on its track.
    pub(super) gone: f64,
    pub(super) longest: f64,
    /// Steps of the stage with all goals at the ends.
    pub(super) settled: usize,
    pub(super) scales: bool,
    /// Whether the paths move other matter from now on.
    pub(super) is_repainted: bool,
    /// What leads it, if its way is not known beforehand.
    pub(super) hand: Option<Hand>,
    /// Forces of the last step.
    pub(super) load: Load<T>,
    /// What they moved.
    pub(super) memory: Memory,
    pub(super) report: ForceReport,
}

impl<T: Real> ForceStroke<T> {
    /// Begins to work on a field whose surface lies at `iso`.
    ///
    /// # Errors
    /// Any [`ForceError`].
    pub fn new(
        field: &HierarchicalSpline<T>,
        iso: f64,
        targets: Vec<Target>,
        extent: Extent,
        radius: f64,
        how: &How,
    ) -> Result<Self, ForceError> {
        if targets.is_empty() {
            return Err(ForceError::tool("the tool has no path"));
        }
        for target in &targets {
            track::within(field, target.path.at(target.path.length()))?;
        }
        let whole = field.lattice().extent() * field.lattice().spacing(0);
        if radius > 0.5 * whole.max_element() {
            return Err(ForceError::tool(format!(
                "a radius of {radius} is wider than the field, {:?}; use a smaller one",
                whole.to_array()
            )));
        }
        let shape = Shape::new(&how.filter).map_err(ForceError::Tool)?;
        let longest = targets.iter().map(|t| t.path.length()).fold(0.0, f64::max);
        let gain = how.gain.map_or(
            match how.solid() {
                Solid::Clay => 15.0,
                Solid::Elastic => 4.0,
            },
            |g| g.0,
        );
        // Elastic springs may not follow at all.
        let extent = match (extent, how.solid()) {
            (Extent::Track, Solid::Elastic) => Extent::Curve,
            (extent, _) => extent,
        };
        let gone = if extent == Extent::Track {
            STAGE * radius
        } else {
            f64::INFINITY
        };
        let first: Vec<&Target> = targets.iter().filter(|t| t.begins <= gone).collect();
        let (layers, holding) = (Layers::new(), Holding::default());
        let ground = Ground {
            field,
            layers: &layers,
            radius,
            roam: 0.0,
        };
        let region = ground.cut(&first)?;
        let samples = region.patch().lattice().sample_count();
        let none = Arrival {
            least: 0.0,
            most: 0.0,
        };
        let stroke = Self {
            origin: field.clone(),
            field: field.clone(),
            region,
            layers,
            holding,
            drawn: Drawn::default(),
            iso,
            radius,
            shape,
            how: how.clone(),
            gain,
            acting: Vec::new(),
            begun: 0,
            extent,
            gone,
            longest,
            settled: 0,
            scales: false,
            is_repainted: false,
            hand: None,
            load: Load::of(std::iter::empty()),
            memory: Memory::default(),
            report: ForceReport {
                paths: targets.len(),
                steps: 0,
                solves: 0,
                arrival: none,
                overshoot: 0.0,
                steps_to_99: None,
                force: 0.0,
                samples,
                cuts: 1,
            },
            targets,
        };
        match stroke.paths_at_face() == stroke.targets.len() {
            true => Err(stroke.with_room().err().unwrap_or_else(|| {
                ForceError::tool(format!(
                    "the tool acts {AT_FACE}; act farther inside, or {INSTEAD}"
                ))
            })),
            false => Ok(stroke),
        }
    }

    /// The same, if no path begins or ends where the box of the field holds it, but for faces that cut the solid off.
    ///
    /// # Errors
    /// [`ForceError::Outside`] of a place beyond the face.
    pub(super) fn with_room(self) -> Result<Self, ForceError> {
        let lattice = self.field.lattice();
        let held = |t: &Target| self.faces_at(t, self.start(t)).collect::<Vec<_>>();
        let held: Vec<_> = self.targets.iter().flat_map(held).collect();
        let first = Face::ALL
            .into_iter()
            .filter_map(|face| held.iter().find(|h| h.1 == face));
        for (place, face) in first.filter(|h| !h.1.cuts(&self.field, self.iso)) {
            let mut local = self.field.lattice_from_world().transform_point3(*place);
            local[face.axis] = match face.is_last {
                true => lattice.extent()[face.axis] + BEYOND,
                false => -BEYOND,
            };
            track::within(&self.field, lattice.world_from_lattice.transform_point3(local))?;
        }
        Ok(self)
    }

    /// Paths that begin or end where the box of the field holds them, and do not act.
    pub fn paths_at_face(&self) -> usize {
        let is_at_face = |t: &&Target| self.is_at_face(t, self.start(t));
        self.targets.iter().filter(is_at_face).count()
    }

    /// Whether a path that met the surface at `start` begins there, or has to end there.
    pub(super) fn is_at_face(&self, target: &Target, start: Option<Start>) -> bool {
        self.faces_at(target, start).next().is_some()
    }

    /// Ends of a path that met the surface at `start`, each with the faces of the box that hold it.
    fn faces_at(&self, target: &Target, start: Option<Start>) -> impl Iterator<Item = (DVec3, Face)> {
        let first = start.map(|start| start.at.max(0.0));
        let last = first.and((!target.ends_early).then_some(target.path.length()));
        let ends = [first, last].map(|end| end.map(|s| target.path.at(s)));
        let ground = self.ground();
        ends.into_iter().flatten().flat_map(move |place| {
            let faces = ground.faces_at(&self.region, place);
            faces.map(move |face| (place, face))
        })
    }

    /// The same on painted matter: stiffness, mass, damping and rest lengths. To be called before the first step.
    ///
    /// # Errors
    /// [`ForceError::Region`], [`ForceError::Step`].
    pub fn painted(mut self, layers: &Layers) -> Result<Self, ForceError> {
        self.layers = layers.clone();
        self.cut_first()?;
        Ok(self)
    }

    /// The same where some places are held. To be called before the first step.
    ///
    /// # Errors
    /// [`ForceError::Region`], [`ForceError::Step`], [`ForceError::Tool`] for more constraints than can be solved for.
    pub fn held(mut self, holding: &Holding) -> Result<Self, ForceError> {
        if !holding.is_none() {
            self.holding = holding.clone();
            self.cut_first()?;
            self.hold()?;
        }
        Ok(self)
    }

    fn cut_first(&mut self) -> Result<(), ForceError> {
        let first: Vec<&Target> = self.targets.iter().filter(|t| t.begins <= self.gone).collect();
        self.region = self.ground().cut(&first)?;
        Ok(())
    }

    /// Goes on with other paint.
    ///
    /// # Errors
    /// [`ForceError::Step`].
    pub fn repaint(&mut self, layers: &Layers) -> Result<(), ForceError> {
        self.layers = layers.clone();
        let ground = Ground {
            field: &self.field,
            layers: &self.layers,
            radius: self.radius,
            roam: ROAM,
        };
        ground.paint(&mut self.region)?;
        self.is_repainted = true;
        Ok(())
    }

    pub(super) fn ground(&self) -> Ground<'_, T> {
        Ground {
            field: &self.field,
            layers: &self.layers,
            radius: self.radius,
            roam: if self.hand.is_some() { ROAM } else { 0.0 },
        }
    }

    /// Makes the constraints ready for a region that was cut.
    pub(super) fn hold(&mut self) -> Result<(), ForceError> {
        self.drawn = self.holding.on(&self.field, &self.region, self.radius)?;
        Ok(())
    }

    /// The region that moves.
    pub fn region(&self) -> &Region<T> {
        &self.region
    }

    /// The field as it is now, which shares with the one before what did not change.
    ///
    /// # Errors
    /// [`ForceError::Region`].
    pub fn baked(&self) -> Result<HierarchicalSpline<T>, ForceError> {
        Ok(self.left(&self.region.bake(&self.field)?))
    }

    /// What limits leave of a field that the stroke has moved.
    fn left(&self, moved: &HierarchicalSpline<T>) -> HierarchicalSpline<T> {
        within(
            &self.origin,
            moved,
            &self.holding.limits,
            self.region.cells().level,
        )
    }

    /// What it has done so far.
    pub fn report(&self) -> &ForceReport {
        &self.report
    }

    /// The value of the field as it is now.
    pub fn value(&self, p: DVec3) -> f64 {
        Functions::of(&self.field, &self.region).value(&self.region.patch().state().p, p)
    }

    /// Whether it springs back when it is let go.
    pub fn is_elastic(&self) -> bool {
        self.how.solid() == Solid::Elastic
    }

    /// Forces on the samples that the last step ended with.
    pub fn load(&self) -> OnBox<'_, T> {
        self.load.on_box()
    }

    /// How a path lay when the stroke began.
    pub(super) fn start(&self, target: &Target) -> Option<Start> {
        target.start(&|p| self.origin.value(p), self.iso, self.radius, self.look())
    }

    /// Arc length of the surface on a path, of what is not beyond its end from the beginning.
    pub(super) fn surface(
        &self,
        target: &Target,
        start: Option<Start>,
        value: &impl Fn(DVec3) -> f64,
    ) -> Option<f64> {
        let crossing = target.crossing(value, self.iso, self.radius, self.look())?;
        Some(self.own(target, start, crossing, target.path.length()))
    }

    /// What of a path up to a crossing is the stroke's, if it is to go to `goal`.
    pub(super) fn own(&self, target: &Target, start: Option<Start>, crossing: f64, goal: f64) -> f64 {
        let before = |p: DVec3| self.origin.value(p);
        start.map_or(crossing, |start| {
            target.own(&before, self.iso, start, [crossing, goal], self.look())
        })
    }

    /// How far the surface at an arc length is beyond the end of a path, as a share of what it has to go.
    pub(super) fn ahead(&self, target: &Target, crossing: f64) -> f64 {
        (crossing - target.path.length()) / self.whole(target)
    }

    /// Length that errors on a path count by: a hand that drags may end where it began.
    pub(super) fn whole(&self, target: &Target) -> f64 {
        let length = target.path.length();
        if self.hand.as_ref().is_some_and(|hand| hand.drags().is_some()) {
            length.max(self.radius)
        } else {
            length
        }
    }

    /// Share of its path to which a surface is brought.
    pub(super) fn share(&self) -> f64 {
        match (self.how.solid(), self.how.rule) {
            (Solid::Elastic, Rule::Arrive) => self.gain / (1.0 + self.gain),
            _ => 1.0,
        }
    }

    /// Length in which nothing of the surface is missed.
    pub(super) fn look(&self) -> f64 {
        let spacing = self
            .field
            .lattice()
            .spacing(self.region.cells().level)
            .min_element();
        (0.5 * spacing).min(0.25 * self.radius)
    }

    /// Lets go: what is left of the field.
    ///
    /// # Errors
    /// [`ForceError::Region`].
    pub fn release(mut self) -> Result<(HierarchicalSpline<T>, ForceReport), ForceError> {
        let field = match self.how.solid() {
            Solid::Clay => self.baked()?,
            Solid::Elastic => self.origin.clone(),
        };
        self.report.arrival = self.arrival(|t| {
            let value = |p| match self.how.solid() {
                Solid::Clay => field.value(p),
                Solid::Elastic => self.value(p),
            };
            self.surface(t, self.start(t), &value)
        });
        Ok((field, self.report))
    }

    /// Of all paths, by where the surface is on each; those without one have arrived.
    fn arrival(&self, crossing: impl Fn(&Target) -> Option<f64>) -> Arrival {
        let share = |t: &Target| crossing(t).map_or(1.0, |s| 1.0 + self.ahead(t, s));
        let none = Arrival {
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        };
        self.targets.iter().map(share).fold(none, |all, s| Arrival {
            least: all.least.min(s),
            most: all.most.max(s),
        })
    }
}
