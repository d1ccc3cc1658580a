#!/bin/sh
# RUSTC_WRAPPER for Rust 1.85, the compiler of Debian that has the sources of the standard library: what became stable until
# 1.89 is there and has to be asked for by name. With a newer compiler nothing is asked for.
rustc=$1
shift
case $("$rustc" --version) in
  "rustc 1.85."*) ;;
  *) exec "$rustc" "$@" ;;
esac
wanted=let_chains
case ${CARGO_PKG_NAME:-} in
  wide) wanted=$wanted,unbounded_shifts,float_next_up_down,integer_sign_cast ;;
  encoding_rs | sha2) wanted=$wanted,slice_as_chunks ;;
  nalgebra) wanted=$wanted,unsigned_is_multiple_of,const_vec_string_slice ;;
  zip | delaunator) wanted=$wanted,unsigned_is_multiple_of ;;
  moiregauge* | spmfile | heterostrain) wanted=$wanted,unsigned_is_multiple_of,slice_as_chunks ;;
  # Parts of the standard library ask for it themselves.
  core | alloc | std | panic_abort | panic_unwind | unwind | proc_macro | test | compiler_builtins | rustc-std-workspace-*) exec "$rustc" "$@" ;;
esac
case ${CARGO_MANIFEST_DIR:-/lib/rustlib/src/} in
  */lib/rustlib/src/*) exec "$rustc" "$@" ;;
esac
exec "$rustc" "$@" "-Zcrate-attr=feature($wanted)"
