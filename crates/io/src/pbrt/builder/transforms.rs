//! Directives that change the current transform.

use moonmilk_core::glam::{DMat4, DVec3};

use super::super::context::Context;
use super::super::lexer::Spot;
use super::Builder;

impl Builder {
    fn transform(&mut self, change: impl Fn(DMat4) -> DMat4) {
        for (matrix, active) in self.state.ctm.iter_mut().zip(self.state.active) {
            if active {
                *matrix = change(*matrix);
            }
        }
    }

    pub(crate) fn identity(&mut self) {
        self.transform(|_| DMat4::IDENTITY);
    }

    pub(crate) fn translate(&mut self, by: [f64; 3]) {
        self.transform(|m| m * DMat4::from_translation(by.into()));
    }

    pub(crate) fn scale(&mut self, by: [f64; 3]) {
        self.transform(|m| m * DMat4::from_scale(by.into()));
    }

    pub(crate) fn rotate(&mut self, cx: &mut Context, spot: Spot, [degrees, x, y, z]: [f64; 4]) {
        match DVec3::new(x, y, z).try_normalize() {
            Some(axis) => self.transform(|m| m * DMat4::from_axis_angle(axis, degrees.to_radians())),
            None => cx.error(spot, "the axis of Rotate has no direction"),
        }
    }

    pub(crate) fn look_at(&mut self, cx: &mut Context, spot: Spot, v: [f64; 9]) {
        let [eye, at, up] = [0, 3, 6].map(|i| DVec3::new(v[i], v[i + 1], v[i + 2]));
        let forward = (at - eye).try_normalize();
        let right = forward.and_then(|f| up.try_normalize()?.cross(f).try_normalize());
        let (Some(forward), Some(right)) = (forward, right) else {
            cx.error(spot, "LookAt: the eye is the point looked at, or the up vector is parallel to the view");
            return;
        };
        // Columns of camera to world: right, up, forward, eye.
        let camera_to_world =
            DMat4::from_cols(right.extend(0.0), forward.cross(right).extend(0.0), forward.extend(0.0), eye.extend(1.0));
        self.transform(|m| m * camera_to_world.inverse());
    }

    /// pbrt writes matrices column by column, the translation last.
    pub(crate) fn set_transform(&mut self, values: [f64; 16]) {
        self.transform(|_| DMat4::from_cols_array(&values));
    }

    pub(crate) fn concat_transform(&mut self, values: [f64; 16]) {
        self.transform(|m| m * DMat4::from_cols_array(&values));
    }

    pub(crate) fn transform_times(&mut self, cx: &mut Context, spot: Spot, _: [f64; 2]) {
        self.before_world(cx, spot, "TransformTimes");
    }

    pub(crate) fn active_transform(&mut self, start: bool, end: bool) {
        self.state.active = [start, end];
    }

    pub(crate) fn coordinate_system(&mut self, name: String) {
        self.coordinate_systems.insert(name, self.state.ctm);
    }

    pub(crate) fn coord_sys_transform(&mut self, cx: &mut Context, at: Spot, name: &str) {
        match self.coordinate_systems.get(name) {
            Some(ctm) => self.state.ctm = *ctm,
            None => cx.warn(at, format!("no coordinate system `{name}` is defined: the transform stays as it is")),
        }
    }

    /// The transform in force; a moving one counts as it is at the start.
    pub(super) fn placement(&self, cx: &mut Context, spot: Spot) -> DMat4 {
        if self.state.ctm[0] != self.state.ctm[1] {
            cx.warn_once(spot, "moving objects are not supported yet: they stay where they start");
        }
        if !self.state.ctm[0].as_mat4().is_finite() {
            cx.error(spot, "the transform in force has values that are not finite");
            return DMat4::IDENTITY;
        }
        self.state.ctm[0]
    }
}
