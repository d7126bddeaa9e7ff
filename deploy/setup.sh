#!/usr/bin/env bash
# Makes .venv with the pinned dependencies and looks for an LLVM that Mitsuba can use.
# `make` calls it; it may be run again at any time, and does only what is missing.
set -euo pipefail
cd "$(dirname "$0")/.."

source deploy/lib.sh

is_python() { "$1" -c "import sys; sys.exit(not ($2))" 2>/dev/null; }

find_python() {
  # Who names one gets it, and a .venv that is made again keeps its own. Every candidate is run: a
  # version manager's shim may exist without its Python. For those before 3.13 a Redis server comes
  # with the dependencies.
  local candidate new_enough='sys.version_info >= (3, 10)'
  if [ -n "${PYTHON:-}" ]; then
    if is_python "$PYTHON" "$new_enough"; then echo "$PYTHON"; return; fi
    say "PYTHON=$PYTHON is no Python 3.10 or newer"
    return 1
  fi
  candidate=$(.venv/bin/python -c 'import sys; print(sys._base_executable)' 2>/dev/null || true)
  if [ -n "$candidate" ] && is_python "$candidate" "$new_enough"; then echo "$candidate"; return; fi
  for candidate in python3.12 python3.11 python3.10 python3; do
    if is_python "$candidate" "$new_enough and sys.version_info < (3, 13)"
    then echo "$candidate"; return; fi
  done
  if is_python python3 "$new_enough"; then echo python3; return; fi
  say "no Python 3.10 or newer was found; install one, or name it: make PYTHON=/path/to/python3"
  return 1
}

make_venv() {
  local python; python=$(find_python)
  say "making .venv with $("$python" --version)"
  if ! "$python" -m venv --clear .venv 2>/dev/null; then
    if ! is_root_on_debian; then
      say "this Python cannot make virtual environments; on Debian or Ubuntu: apt install python3-venv"
      return 1
    fi
    apt_install python3-venv
    "$python" -m venv --clear .venv
  fi
  fetch .venv/bin/python -m pip install -q --disable-pip-version-check -c constraints.txt uv
  fetch .venv/bin/uv pip install -q --compile-bytecode --python .venv/bin/python -c constraints.txt -e '.[all,dev]'
}

find_redis() {
  .venv/bin/python -c \
    'import sys; from plateau.farm.redis.embedded import find_redis_server; sys.exit(find_redis_server() is None)' \
    && return 0
  if is_root_on_debian && apt_install redis-server; then return 0; fi
  say "no redis-server, so Plateau can start none of its own: install Redis 6.2 or newer" \
      "(apt install redis-server; brew install redis), or use Python 3.10 to 3.12."
}

variant() { .venv/bin/python -m plateau doctor --json | .venv/bin/python -c \
  'import json, sys; print(json.load(sys.stdin)["variant"])' || echo scalar_rgb; }

find_llvm() {
  [ "$(variant)" = scalar_rgb ] || return 0
  if is_root_on_debian; then
    local package
    apt-get update -qq >/dev/null 2>&1 || true
    for package in $(apt-cache search --names-only '^libllvm[0-9]+$' | cut -d' ' -f1 | sort -rV); do
      [ "${package#libllvm}" -ge 17 ] || break  # older ones abort or are refused
      if apt_install "$package" && [ "$(variant)" != scalar_rgb ]; then return 0; fi
    done
  fi
  say "no usable LLVM: rendering goes on with scalar_rgb, at about a third of the speed." \
      "To mend it install LLVM 17 or newer (Debian: apt install libllvm19; macOS: brew install llvm)."
}

find_chromium() {
  # Its headless shell takes two thirds of the time.
  command -v chromium-headless-shell >/dev/null && return 0
  if is_root_on_debian && { apt_install chromium-headless-shell || apt_install chromium; }; then return 0; fi
  command -v chromium >/dev/null || command -v chromium-browser >/dev/null \
    || command -v google-chrome >/dev/null && return 0
  say "no Chromium: the tests of the web page are skipped (Debian, Ubuntu: apt install chromium)."
}

# What .venv was made from; when that changes, it is made again.
wanted=$(cat pyproject.toml constraints.txt | cksum)
if [ "$(cat .venv/made-from 2>/dev/null)" != "$wanted" ]; then
  make_venv
  find_libraries
  find_redis
  find_llvm
  find_chromium
  say "compiling the model of vision (half a minute, once)"
  .venv/bin/python -c 'from plateau.picture.judge import warm_up; warm_up()'
  echo "$wanted" > .venv/made-from
fi
