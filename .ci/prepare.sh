# Sourced by ./demo, ./check, ./bench and .ci/run: installs what a fresh Debian lacks, and says so.

# Installs packages, or prints the command and stops where that needs a right that we lack.
install_packages() {
    local command="apt-get install -y --no-install-recommends $*"
    if ! command -v apt-get >/dev/null; then
        echo "missing: $*; install them with this system's package manager" >&2
        exit 1
    fi
    if [ "$(id -u)" -ne 0 ]; then
        echo "missing: $*; install them as root, then run this again:" >&2
        echo "    apt-get update && $command" >&2
        exit 1
    fi
    echo "installing: $*"
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive $command
}

# Whether the system has a Vulkan loader and any driver for it.
has_vulkan() {
    [ "$(uname -s)" = Linux ] || return 0
    ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1' || return 1
    [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
}

# What building needs, and a Vulkan driver: Mesa's, which runs on any processor, where there is none.
install_missing() {
    if ! command -v cargo >/dev/null && [ -x "$HOME/.cargo/bin/cargo" ]; then
        PATH="$HOME/.cargo/bin:$PATH"
    fi
    if ! command -v cargo >/dev/null; then
        echo "missing: Rust; install it from https://rustup.rs, then run this again" >&2
        exit 1
    fi
    local packages=()
    command -v cc >/dev/null || packages+=(gcc libc6-dev)
    has_vulkan || packages+=(mesa-vulkan-drivers libvulkan1)
    [ "${#packages[@]}" -eq 0 ] || install_packages "${packages[@]}"
    # Silences a warning of Mesa's.
    export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-${TMPDIR:-/tmp}}"
}

# Scenes come from $HEMISPLAT_SCENES, or from a folder shared/scenes in or beside the checkout.
find_scenes() {
    local scenes
    for scenes in shared/scenes ../shared/scenes; do
        if [ -z "${HEMISPLAT_SCENES:-}" ] && [ -d "$scenes" ]; then
            HEMISPLAT_SCENES="$(cd "$scenes" && pwd)"
            export HEMISPLAT_SCENES
        fi
    done
}

# As the page's build looks for it.
can_build_for_browsers() {
    [ -d "$(rustc --print sysroot)/lib/rustlib/wasm32-unknown-unknown" ] || { [ -x /usr/bin/cargo ] && [ -x /usr/bin/rustc ] && [ -e /usr/bin/rust-lld ] && [ -d /usr/lib/rustlib/src/rust/library ]; }
}

# What tests can be required to find, as in HEMISPLAT_REQUIRE.
what_is_here() {
    local here=gpu
    if [ -d "${HEMISPLAT_SCENES:-}" ]; then
        here+=,scenes
        [ ! -x "${PEERS_HOME:-$HOME/.cache/hemisplat-peers}/bin/python" ] || here+=,peers
    fi
    ! command -v chromium >/dev/null || here+=,browser
    ! can_build_for_browsers || here+=,wasm
    echo "$here"
}

# How to have what a test lacks.
how_to_have() {
    case "$1" in
    gpu) echo "a Vulkan driver, such as Debian's mesa-vulkan-drivers" ;;
    scenes) echo "HEMISPLAT_SCENES names a folder with sibenik/sibenik.obj and sponza/sponza.obj" ;;
    browser) echo "Debian's chromium" ;;
    wasm) echo "rustup target add wasm32-unknown-unknown, or Debian's rustc-web, cargo-web, rust-web-src and lld-22" ;;
    peers) echo "./bench peers, beside the scenes" ;;
    tools) echo "the programs that the lines name; limits of threads need a folder that every user may read" ;;
    adapter) echo "another adapter (WGPU_ADAPTER_NAME)" ;;
    esac
}

# What the tests of a log left out: how many, which, why, and how to have it; and how many are too long for every run.
tell_skipped() {
    local lines needs need
    lines="$(grep '^SKIPPED: ' "$1" | sort -u || true)"
    needs="$(sed -nE 's/.*\[([a-z]+)\]$/\1/p' <<<"$lines" | sort -u)"
    if [ -z "$lines" ]; then
        echo "skipped: none"
    else
        echo "skipped: $(wc -l <<<"$lines")"
        sed 's/^SKIPPED: /    /' <<<"$lines"
    fi
    for need in $needs; do
        echo "for [$need]: $(how_to_have "$need")"
    done
    # Counted by the tests' own sums, so that what is ignored in silence shows here.
    local ignored
    ignored="$(sed -nE 's/^test result: .* ([0-9]+) ignored;.*/\1/p' "$1" | awk '{ sum += $1 } END { print sum + 0 }')"
    echo "too long for every run: $((ignored - $(grep -c . <<<"$lines" || true))) (cargo test -- --ignored)"
}
