//! A method while it solves a step, and what it gives back.

use proxel_split::{Admm, Auto, Hessian, Method, NormalMatrix, Parts, Problem};

/// A method at work on a step.
pub(super) enum Running {
    Admm(Box<Admm>),
    Auto(Box<Auto>),
    /// A method that keeps its matrix to itself: it is factored anew for each step.
    Other(Box<dyn Method>),
}

/// What a method gives back.
pub(super) struct Back {
    pub problem: Problem,
    pub normal: Option<NormalMatrix>,
    pub hessian: Option<Hessian>,
}

impl Running {
    pub fn method(&mut self) -> &mut dyn Method {
        match self {
            Running::Admm(admm) => admm.as_mut(),
            Running::Auto(auto) => auto.as_mut(),
            Running::Other(method) => method.as_mut(),
        }
    }

    pub fn give_back(self) -> Back {
        let nothing = || Back { problem: Problem::empty(), normal: None, hessian: None };
        match self {
            Running::Admm(admm) => {
                let (problem, normal, _, _) = admm.into_parts();
                Back { problem, normal: Some(normal), hessian: None }
            }
            Running::Auto(auto) => auto.into_parts().map_or_else(nothing, |parts| {
                let Parts { problem, normal, hessian, .. } = parts;
                Back { problem, normal: Some(normal), hessian }
            }),
            Running::Other(method) => Back { problem: method.into_problem(), ..nothing() },
        }
    }
}
