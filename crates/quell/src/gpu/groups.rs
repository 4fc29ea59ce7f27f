//! Bind groups, kept from frame to frame as long as the same textures are bound.

/// Bind groups of a program's dispatches, one for each turn: what alternates comes back at every other frame, and so may
/// the host's textures. They hold on to the host's textures until other ones are bound at the same turn.
#[derive(Debug, Default)]
pub(super) struct Groups(Vec<[Option<Group>; 2]>);

#[derive(Debug)]
struct Group {
    views: Vec<wgpu::TextureView>,
    group: wgpu::BindGroup,
}

impl Groups {
    /// Another program, or other buffers.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// The group of a dispatch that binds these views, of the last time or made anew; `None`: it cannot be made.
    pub(super) fn get<'v>(
        &mut self,
        dispatch: usize,
        turn: usize,
        views: impl Iterator<Item = &'v wgpu::TextureView> + Clone,
        make: impl FnOnce() -> Option<wgpu::BindGroup>,
    ) -> Option<&wgpu::BindGroup> {
        if self.0.len() <= dispatch {
            self.0.resize_with(dispatch + 1, Default::default);
        }
        let kept = self.0.get_mut(dispatch)?.get_mut(turn)?;
        // wgpu's resources are equal where they are the same object.
        if !kept.as_ref().is_some_and(|kept| kept.views.iter().eq(views.clone())) {
            *kept = make().map(|group| Group { views: views.cloned().collect(), group });
        }
        kept.as_ref().map(|kept| &kept.group)
    }
}
