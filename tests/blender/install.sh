#!/usr/bin/env bash
# Makes .venv-blender: Plateau with the extra `blender`, as users install it. Blender's module asks
# for numpy 1; all else has the pinned versions.
set -euo pipefail
cd "$(dirname "$0")/../.."
source deploy/lib.sh

wanted=$(cat pyproject.toml constraints.txt | cksum)
if [ "$(cat .venv-blender/made-from 2>/dev/null)" = "$wanted" ]; then exit 0; fi
say "making .venv-blender (2 GB, once)"
.venv/bin/uv venv -q --clear --python 3.11 .venv-blender
.venv/bin/uv pip install -q --python .venv-blender/bin/python -c <(grep -v '^numpy==' constraints.txt) \
  -e '.[all,blender,dev]'
echo "$wanted" > .venv-blender/made-from
