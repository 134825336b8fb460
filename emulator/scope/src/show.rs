//! What a program shows beside MAVLink.

use serde::de::DeserializeOwned;

/// What a program shows beside MAVLink.
pub trait Show: Send + Sync + 'static {
    /// What a page may ask for; it comes as JSON.
    type Asked: DeserializeOwned + Send + 'static;

    /// What is kept for a viewer from one answer to the next.
    type Held: Default;

    /// The answer to what can be answered at once, on the viewer's thread, so that it holds up no other; what it is
    /// not for, is the program's.
    ///
    /// # Errors
    /// What was asked, for the program.
    fn answer(&self, held: &mut Self::Held, asked: Self::Asked) -> Result<Vec<u8>, Self::Asked>;

    /// The first viewer has come, or the last has gone.
    fn viewed(&self, is_viewed: bool);
}
