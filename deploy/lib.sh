# What the set-up scripts share; sourced, from the root of the project.

say() { printf '%s\n' "setup: $*" >&2; }

is_root_on_debian() { [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; }

apt_install() {
  say "installing $* with apt-get"
  if ! DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@" >/dev/null 2>&1; then
    apt-get update -qq >/dev/null 2>&1 || true
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq "$@" >/dev/null
  fi
}

fetch() {
  # Runs what fetches packages; behind a proxy with a certificate of its own, says what to set.
  local said status=0; said=$(mktemp)
  "$@" 2>"$said" || status=$?
  cat "$said" >&2
  if [ $status != 0 ] && grep -qE 'UnknownIssuer|CERTIFICATE_VERIFY_FAILED' "$said"; then
    say "a proxy here seems to have a certificate of its own: export SSL_CERT_FILE=/path/of/your/ca.pem," \
        "or UV_SYSTEM_CERTS=true where the system knows it, and run this again."
  fi
  rm -f "$said"
  return $status
}

find_libraries() {
  # What wheels need of the system, and slim images lack: plateau/worker/supervisor/needed_libraries.py has the list.
  local packages; packages=$(.venv/bin/python -m plateau.worker.supervisor.needed_libraries)
  [ -n "$packages" ] || return 0
  # shellcheck disable=SC2086  # one word for each package
  if is_root_on_debian && apt_install $packages; then return 0; fi
  say "rendering needs libraries that are missing here; install them" \
      "(Debian, Ubuntu: apt install $packages)."
}
