//! What tools of many points do, in virtual time with scripted poses.

mod contacts;
mod cost;
mod features;
mod growth;
mod hostile;
mod scenes;
