#!/usr/bin/env bash
# The packages for arm64, installed beside this machine's own architecture and run under qemu: `platen demo` of a user without rights. By hand, on a Debian 12
# for amd64 whose user is root: it builds everything once more, a quarter of an hour on two cores.
#
#     bash tests/peers/arm64.sh
#
# The compiler is Debian's, as its std for arm64 lies beside it; rustup's has none here to add. Exit code 1: a step failed.
set -euo pipefail
cd "$(dirname "$0")/../.."
triple=aarch64-unknown-linux-gnu
dpkg --add-architecture arm64
apt-get update -qq
cargo install --quiet --locked cargo-deb@3.8.0 cargo-auditable@0.7.7 auditable2cdx@0.1.0
apt-get install -y -qq rustc-web gcc-aarch64-linux-gnu qemu-user-static libc6:arm64 libgcc-s1:arm64 >/dev/null

std=$PWD/target/arm64
mkdir -p "$std"
(cd "$std" && apt-get download -qq libstd-rust-web-dev:arm64 && dpkg -x libstd-rust-web-dev_*_arm64.deb .)
ln -sfn "$std/usr/lib/rustlib/$triple" "/usr/lib/rustlib/$triple"

# Programs of arm64 are started by qemu: their own worker processes too, whose environment is empty.
[ -e /proc/sys/fs/binfmt_misc/register ] || mount -t binfmt_misc none /proc/sys/fs/binfmt_misc
[ -e /proc/sys/fs/binfmt_misc/qemu-aarch64 ] || cat /usr/lib/binfmt.d/qemu-aarch64.conf > /proc/sys/fs/binfmt_misc/register

export RUSTC=/usr/bin/rustc CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc CC_aarch64_unknown_linux_gnu=aarch64-linux-gnu-gcc
mapfile -t packages < <(bash .ci/package $triple)
[ ${#packages[@]} = 3 ]
apt-get install -y -qq --reinstall "${packages[@]}" >/dev/null
file -L /usr/bin/platen
place=$(mktemp -d) && chown nobody "$place"
(cd "$place" && setpriv --reuid=nobody --regid=nogroup --clear-groups env HOME="$place" platen demo --out "$place/demo")
dpkg --purge platen-dev:arm64 platen-sim:arm64 platen:arm64
