//! What tools of many points do, in virtual time with scripted poses.

mod bricks;
mod contacts;
mod cost;
mod features;
mod friction;
mod growth;
mod hostile;
mod scenes;
