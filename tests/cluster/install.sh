#!/usr/bin/env bash
# Installs what the tests of this folder start, as root on Debian, and only what is missing.
# Arguments choose among the parts, each a function install_PART; without any, all are installed.
set -euo pipefail
cd "$(dirname "$0")/../.."
source deploy/lib.sh

# Puts a Go on the PATH that is new enough. Debian 12's is not, but can fetch one, as a module.
need_go() {
  PATH=$PATH:/usr/local/go/bin
  command -v go >/dev/null || apt_install golang-go
  if [ "$(printf '%s\n' go1.21 "$(go env GOVERSION)" | sort -V | head -n 1)" = go1.21 ]; then return; fi
  say "fetching a Go that is newer than $(go env GOVERSION)"
  local root
  root=$(module_dir "golang.org/toolchain@v0.0.1-go1.26.8.$(go env GOOS)-$(go env GOARCH)")
  chmod -R +x "$root/bin" "$root/pkg/tool"  # modules have no programs
  PATH=$root/bin:$PATH
}

# module_dir MODULE@VERSION: where Go keeps the module's files, fetched where it has none.
module_dir() {
  (cd / && go mod download -json "$1") | sed -n 's/^\t"Dir": "\(.*\)",$/\1/p'
}

# go_tool NAME MODULE@VERSION: build a program into .cluster-tools/bin, once for each version.
go_tool() {
  local name=$1 module=$2 bin=$PWD/.cluster-tools/bin
  if [ -x "$bin/$name" ] && [ "$(cat "$bin/.$name" 2>/dev/null)" = "$module" ]; then return; fi
  need_go
  say "building $name (a minute or two, once)"
  mkdir -p "$bin"
  GOBIN=$bin/new-$name go install -trimpath "$module"
  mv "$bin/new-$name"/* "$bin/$name"  # a module may call it otherwise
  rmdir "$bin/new-$name"
  echo "$module" > "$bin/.$name"
}

# our_program NAME [LDFLAGS]: build a program of tests/cluster/kubernetes/programs, once for each state
# of it. Its go.mod names what it imports; the versions of the rest follow from those.
our_program() {
  local name=$1 bin=$PWD/.cluster-tools/bin from=tests/cluster/kubernetes/programs/$1 made
  if [ -x "$bin/$name" ] && [ "$(cat "$bin/.$name" 2>/dev/null)" = "$(cat "$from"/*)" ]; then return; fi
  need_go
  say "building $name (minutes, once)"
  made=$(mktemp -d) && cp "$from"/* "$made/"
  (cd "$made" && CGO_ENABLED=0 go build -mod=mod -trimpath -gcflags='all=-N -l' \
    -ldflags="-s -w ${2:-}" -o "$bin/$name")
  rm -r "$made"
  cat "$from"/* > "$bin/.$name"
}

# KEDA's two programs, with the libraries that its own go.mod names, and the objects that install it.
keda() {
  local bin=$PWD/.cluster-tools/bin module=github.com/kedacore/keda/v2@v2.21.0 from name
  if [ "$(cat "$bin/.keda" 2>/dev/null)" = $module ]; then return; fi
  need_go
  say "building keda (ten minutes, once)"
  from=$(module_dir $module)
  for name in keda=operator keda-adapter=adapter; do
    (cd "$from" && CGO_ENABLED=0 go build -trimpath -gcflags='all=-N -l' -ldflags='-s -w' \
      -o "$bin/${name%=*}" "./cmd/${name#*=}")
  done
  "$bin/kubectl" kustomize "$from/config/minimal" \
    | sed 's|image: ghcr.io/.*|image: plateau.test/keda:2.21.0|; s|\(imagePullPolicy:\) Always|\1 Never|' \
    > .cluster-tools/keda.yaml
  echo $module > "$bin/.keda"
}

# All that Debian's Redis 7 is lies in redis-tools, which starts no server.
debian_redis() {
  command -v redis-check-rdb >/dev/null || apt_install redis-tools
  mkdir -p .cluster-tools/bin
  ln -sf "$(command -v redis-check-rdb)" .cluster-tools/bin/redis-server
  ln -sf "$(command -v redis-check-rdb)" .cluster-tools/bin/redis-sentinel
}

# --- the parts, in alphabetical order ---

# The Helm chart and the compose file: what their schemas come with, and helm itself (minutes to build,
# so without optimisation).
install_chart() {
  local folder=$PWD/.cluster-tools/schemas python=.venv/bin/python from files file
  local wanted="kubernetes-validate==1.37.0
github.com/kedacore/keda/v2@v2.21.0 config/crd/bases/keda.sh_scaledobjects.yaml config/crd/bases/keda.sh_triggerauthentications.yaml schema/generated/scalers-schema.json
github.com/prometheus-operator/prometheus-operator@v0.85.0 example/prometheus-operator-crd/monitoring.coreos.com_servicemonitors.yaml
github.com/compose-spec/compose-go/v2@v2.16.2 schema/compose-spec.json"
  if [ "$(cat "$folder/made-from" 2>/dev/null)" != "$wanted" ]; then
    need_go
    [ -x $python ] || python=python3
    rm -rf "$folder" && mkdir -p "$folder"
    while read -r from files; do
      case $from in
        *==*) $python -m pip install -q --disable-pip-version-check --root-user-action ignore --no-deps --target "$folder" "$from" ;;
        *) from=$(module_dir "$from")
           for file in $files; do install -m 644 "$from/$file" "$folder/"; done ;;
      esac
    done <<< "$wanted"
    echo "$wanted" > "$folder/made-from"
  fi
  GOFLAGS="${GOFLAGS:-} '-gcflags=all=-N -l'" CGO_ENABLED=0 go_tool helm helm.sh/helm/v3/cmd/helm@v3.19.5
}

# Bare machines: a Redis with TLS, and sentinels.
install_bare() {
  command -v systemd-analyze >/dev/null || apt_install systemd
  debian_redis
}

# An image, for the long form: what builds one without a daemon, and unpacks a Debian for it.
install_image() {
  [ "${CLUSTER_TESTS:-long}" = long ] || return 0
  command -v buildah >/dev/null && command -v mmdebstrap >/dev/null || apt_install buildah mmdebstrap
}

# A Kubernetes of one node, and images of the farm (a quarter of an hour, once); it has no short form.
install_kubernetes() {
  [ "${CLUSTER_TESTS:-long}" = long ] || return 0
  local name version=1.34.2 set="-X k8s.io/component-base/version"
  for name in conntrack containerd debootstrap etcd ip iptables runc /usr/lib/cni/bridge; do
    if ! PATH=$PATH:/usr/sbin:/sbin command -v $name >/dev/null; then
      apt_install conntrack containerd containernetworking-plugins debootstrap etcd-server iproute2 iptables runc
      break
    fi
  done
  install_chart
  debian_redis
  our_program coredns
  our_program kube "$set.gitVersion=v$version $set.gitMajor=1 $set.gitMinor=34"
  for name in kube-apiserver kube-controller-manager kube-proxy kube-scheduler kubectl kubelet; do
    ln -sf kube ".cluster-tools/bin/$name"
  done
  keda
  go_tool versitygw github.com/versity/versitygw/cmd/versitygw@v1.8.0
  say "building images (minutes, and seconds where little has changed)"
  .venv/bin/python -m tests.cluster.kubernetes.images
}

# Networks that fail, by losing packets.
install_network() {
  command -v ip >/dev/null && command -v iptables-legacy >/dev/null || apt_install iproute2 iptables
}

# Ray, in an environment of its own beside .venv: seconds, and 1 GB that are mostly shared with .venv's.
install_ray() {
  local wanted; wanted=$(cat pyproject.toml constraints.txt | cksum)
  [ "$(cat .cluster-tools/ray/made-from 2>/dev/null)" != "$wanted" ] || return 0
  say "making .cluster-tools/ray"
  fetch .venv/bin/uv venv -q --clear --python .venv/bin/python .cluster-tools/ray
  fetch .venv/bin/uv pip install -q --python .cluster-tools/ray/bin/python -c constraints.txt -e '.[ray]'
  echo "$wanted" > .cluster-tools/ray/made-from
}

# An S3 server; and for the long form another one (minutes to build).
install_s3() {
  go_tool versitygw github.com/versity/versitygw/cmd/versitygw@v1.8.0
  [ "${CLUSTER_TESTS:-long}" = long ] || return 0
  go_tool minio github.com/minio/minio@v0.0.0-20260212201848-7aac2a2c5b7c
}

# Slurm, whose daemons the tests start themselves.
install_slurm() {
  [ -x /usr/sbin/slurmctld ] && [ -x /usr/sbin/slurmd ] && [ -x /usr/bin/sbatch ] \
    && [ -x /usr/sbin/munged ] || apt_install slurm-wlm munge
}

# --- end of the parts ---

parts=("$@")
[ $# -gt 0 ] || mapfile -t parts < <(compgen -A function install_ | sed s/^install_//)
for part in "${parts[@]}"; do
  declare -F "install_$part" >/dev/null || { say "no such part: $part"; exit 2; }
  "install_$part"
done
