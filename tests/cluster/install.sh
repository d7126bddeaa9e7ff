#!/usr/bin/env bash
# Installs what the tests of this folder start, as root on Debian, and only what is missing.
# Arguments choose among the parts, each a function install_PART; without any, all are installed.
set -euo pipefail
cd "$(dirname "$0")/../.."
source deploy/lib.sh

# go_tool NAME MODULE@VERSION: build a program into .cluster-tools/bin, once for each version.
go_tool() {
  local name=$1 module=$2 bin=$PWD/.cluster-tools/bin
  if [ -x "$bin/$name" ] && [ "$(cat "$bin/.$name" 2>/dev/null)" = "$module" ]; then return; fi
  command -v go >/dev/null || apt_install golang-go
  say "building $name (a minute or two, once)"
  mkdir -p "$bin"
  GOBIN=$bin go install -trimpath "$module"
  echo "$module" > "$bin/.$name"
}

# --- the parts, in alphabetical order ---

# --- end of the parts ---

parts=("$@")
[ $# -gt 0 ] || mapfile -t parts < <(compgen -A function install_ | sed s/^install_//)
for part in "${parts[@]}"; do
  declare -F "install_$part" >/dev/null || { say "no such part: $part"; exit 2; }
  "install_$part"
done
