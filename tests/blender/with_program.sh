#!/usr/bin/env bash
# Runs a command on a Debian of its own, in .blender-program, which has a `blender` program, its
# Python, and Plateau installed for that: as on a machine where nobody installed Blender's module.
# Root on Debian. The root is made once (3 GB), from Debian's unstable release, the first one with a
# Blender that is new enough.
set -euo pipefail
cd "$(dirname "$0")/../.."
source deploy/lib.sh

root=$PWD/.blender-program

inside() {  # a command, with this repository at /plateau; its mounts end with it
  env -i HOME=/root LANG=C.UTF-8 PATH=/venv/bin:/usr/sbin:/usr/bin:/sbin:/bin ROOT="$root" \
    unshare --mount --propagation private bash -c '
      mkdir -p "$ROOT/plateau"
      mount --bind . "$ROOT/plateau"
      mount --rbind /dev "$ROOT/dev"
      mount -t proc none "$ROOT/proc"
      mount --rbind /sys "$ROOT/sys"
      exec chroot "$ROOT" bash -c '\''cd /plateau && exec "$@"'\'' bash "$@"' bash "$@"
}

make_root() {
  say "making .blender-program (3 GB, once)"
  command -v debootstrap >/dev/null || apt_install debootstrap
  rm -rf "$root"
  debootstrap --variant=minbase --include=ca-certificates,git,python3-venv sid "$root" >/dev/null
  # Who brings certificates of his own needs them there, too.
  [ -z "${SSL_CERT_FILE:-}" ] || cp "$SSL_CERT_FILE" "$root/etc/ssl/certs/ca-certificates.crt"
  inside apt-get -qq install -y --no-install-recommends blender python3-cattr redis-server \
    >/dev/null
}

install() {
  inside python3 -m venv --clear /venv
  inside python -m pip install -q --disable-pip-version-check -c constraints.txt uv
  inside env SSL_CERT_FILE=/etc/ssl/certs/ca-certificates.crt \
    uv pip install -q --python /venv/bin/python -c constraints.txt -e '.[all,dev]'
}

[ -e "$root/made" ] || { make_root && touch "$root/made"; }
wanted=$(cat pyproject.toml constraints.txt | cksum)
if [ "$(cat "$root/made-from" 2>/dev/null)" != "$wanted" ]; then
  install
  echo "$wanted" > "$root/made-from"
fi
inside "$@"
