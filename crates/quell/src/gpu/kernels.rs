//! The compiled passes of programs, each once.

use super::kernel::Kernel;
use super::pass::Pass;
use super::program::{Dispatch, Program};
use std::collections::HashMap;

#[derive(Clone, Debug, Default)]
pub(super) struct Kernels(HashMap<(&'static str, bool), Kernel>);

impl Kernels {
    /// Compiles what a program needs and is not there yet.
    pub(super) fn ensure(&mut self, device: &wgpu::Device, program: &Program) {
        for dispatch in &program.dispatches {
            let make = || Kernel::new(device, dispatch.pass, program.storage, dispatch.host_input);
            self.0.entry(Self::key(dispatch)).or_insert_with(make);
        }
    }

    pub(super) fn get(&self, dispatch: &Dispatch) -> Option<&Kernel> {
        self.0.get(&Self::key(dispatch))
    }

    const fn key(dispatch: &Dispatch) -> (&'static str, bool) {
        let Pass { name, .. } = dispatch.pass;
        (name, dispatch.host_input)
    }
}
