//! Which planes of a program can have one texture: those of one format whose lives do not overlap.

use super::program::{Program, Role};
use super::slot::Slot;
use super::storage::Texel;

/// A plane from the first dispatch that binds it to the last one, both included.
#[derive(Clone, Copy)]
struct Life {
    resource: usize,
    texel: Texel,
    begin: usize,
    end: usize,
}

/// A texture that is given out: whose it is, who had it last, and until when.
struct Texture {
    home: usize,
    last: Life,
}

pub(super) fn share(program: &mut Program) {
    let mut lives: Vec<Life> = (0..program.resources.len()).filter_map(|index| life(program, index)).collect();
    lives.sort_by_key(|life| life.begin);
    let mut textures: Vec<Texture> = Vec::new();
    for life in lives {
        let is_free = |t: &&mut Texture| t.last.texel == life.texel && t.last.end < life.begin;
        let Some(texture) = textures.iter_mut().find(is_free) else {
            textures.push(Texture { home: life.resource, last: life });
            continue;
        };
        if let Some(before) = program.resources.get_mut(texture.last.resource) {
            before.lasts = false;
        }
        if let Some(resource) = program.resources.get_mut(life.resource) {
            resource.shares = Some(texture.home);
        }
        texture.last = life;
    }
}

/// `None`: it has its texture for itself.
fn life(program: &Program, index: usize) -> Option<Life> {
    let resource = program.resources.get(index)?;
    let end = match resource.role {
        // Debug views read it after the frame.
        _ if resource.slot == Slot::Moving => return None,
        Role::Output => Some(usize::MAX),
        Role::Transient => None,
        _ => return None,
    };
    let binds = |k: &usize| program.dispatches.get(*k).is_some_and(|d| d.bound.iter().any(|b| b.resource == index));
    let mut bound = (0..program.dispatches.len()).filter(binds);
    let begin = bound.next()?;
    let end = end.or(bound.next_back()).unwrap_or(begin);
    Some(Life { resource: index, texel: resource.texel()?, begin, end })
}
