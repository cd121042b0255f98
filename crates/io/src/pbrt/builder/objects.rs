//! Objects: shapes that are defined once and stand in several places.

use super::super::context::Context;
use super::super::lexer::Spot;
use super::Builder;

impl Builder {
    pub(crate) fn object_begin(&mut self, cx: &mut Context, spot: Spot, at: Spot, name: String) {
        self.in_world(cx, spot, "ObjectBegin");
        self.push(cx, spot, true);
        if let Some((outer, _)) = &self.object {
            let message = format!("object `{name}` begins within object `{outer}`");
            cx.error(spot, message);
        } else if self.objects.contains_key(&name) {
            cx.error(at, format!("object `{name}` is defined twice"));
        } else {
            self.object = Some((name, Vec::new()));
        }
    }

    pub(crate) fn object_end(&mut self, cx: &mut Context, spot: Spot) {
        if self.stack.len() <= self.floor() || self.stack.last().is_none_or(|s| !s.object) {
            cx.error(spot, "ObjectEnd without ObjectBegin, or with an attribute block still open");
            return;
        }
        if let Some(saved) = self.stack.pop() {
            self.state = saved.state;
        }
        if let Some((name, shapes)) = self.object.take() {
            self.objects.insert(name, shapes);
        }
    }

    pub(crate) fn object_instance(&mut self, cx: &mut Context, at: Spot, name: String) {
        self.in_world(cx, at, "ObjectInstance");
        if self.object.is_some() {
            cx.error(at, "ObjectInstance cannot stand within ObjectBegin and ObjectEnd");
            return;
        }
        if self.instances.len() >= cx.options.max_shapes {
            cx.warn_once(at, format!("more than {} instances: the rest is left out", cx.options.max_shapes));
            self.too_many = true;
            return;
        }
        let placement = self.placement(cx, at);
        self.instances.push((name, at, placement));
    }
}
