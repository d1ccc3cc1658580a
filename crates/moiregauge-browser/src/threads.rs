//! Functions that the standard library of Rust 1.96 calls and older libraries of C for WASI lack: threads and `realpath`. Each call fails, and the page
//! works without them: it has one thread and no links.
#![expect(unsafe_code, reason = "the linker finds functions by their names")]

use std::ffi::c_void;
use std::ptr::null_mut;

/// `ENOSYS` of WASI preview 1: a function that is not supported.
const NOT_SUPPORTED: i32 = 52;

#[unsafe(no_mangle)]
extern "C" fn pthread_create(
    _: *mut c_void,
    _: *const c_void,
    _: *mut c_void,
    _: *mut c_void,
) -> i32 {
    NOT_SUPPORTED
}

#[unsafe(no_mangle)]
extern "C" fn pthread_join(_: *mut c_void, _: *mut c_void) -> i32 {
    NOT_SUPPORTED
}

#[unsafe(no_mangle)]
extern "C" fn pthread_detach(_: *mut c_void) -> i32 {
    NOT_SUPPORTED
}

#[unsafe(no_mangle)]
extern "C" fn pthread_attr_init(_: *mut c_void) -> i32 {
    0
}

#[unsafe(no_mangle)]
extern "C" fn pthread_attr_setstacksize(_: *mut c_void, _: usize) -> i32 {
    0
}

#[unsafe(no_mangle)]
extern "C" fn pthread_attr_destroy(_: *mut c_void) -> i32 {
    0
}

#[unsafe(no_mangle)]
extern "C" fn realpath(_: *const c_void, _: *mut c_void) -> *mut c_void {
    null_mut()
}
