//! A server from outside: requests as bytes over TCP, of the page and of those who may not ask.

mod asks;
mod common;
mod connections;
mod guard;
mod paths;
mod uploads;
mod works;
