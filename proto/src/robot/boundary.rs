//! What is at the edges of an arena.

/// What happens to a robot at the edges of its world.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Boundary {
    /// A wall at the world's padding from each edge: a robot's body stays within, apart from pushes by other robots.
    #[default]
    Walls,
    /// Nothing: robots may leave the world, and no sensor sees a wall.
    Open,
}
