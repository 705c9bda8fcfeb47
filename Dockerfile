# The whole reproduction in one image: packages and Release build at `docker build`, experiments at `docker run`.
#
#   docker build -t sgf --build-arg REVISION="$(git describe --always --dirty --abbrev=40)" .
#   docker run --rm --user "$(id -u):$(id -g)" \
#     -v "$PWD/results:/opt/beyond-photometric/results" \
#     -v /path/to/datasets:/data:ro sgf --data /data
#
# The second mount and `--data` are optional. Arguments are those of reproduce.sh; `test` runs the tests.
# Results go to the first mount, best the results/ folder of a clone: it also holds the reference files
# that the tests compare with.
#
#   --build-arg REVISION=...             what is built, for programs and runs to put on record: there is no git in the
#                                        image; "unknown" without it
#   --build-arg BASE=debian@sha256:...   the base image, here pinned by its digest
#   --build-arg SUITE=smoke              no tests in the image; table1 is made once at `docker build`, as a trial
#
# Versions of all packages in an image: docker run --rm --entrypoint cat sgf /usr/share/beyond-photometric/packages.txt
ARG BASE=debian:bookworm-slim
FROM ${BASE}
ARG BASE
ARG SUITE=full
LABEL org.opencontainers.image.title="beyond-photometric" \
      org.opencontainers.image.licenses="BSD-3-Clause" \
      org.opencontainers.image.base.name="${BASE}"

# Slim images leave /usr/share/doc out of every installation; one real stereo pair lives there.
COPY packages.apt /tmp/packages.apt
RUN case "${SUITE}" in \
      full) sections='[run] [report] [test]' ;; \
      smoke) sections='[run] [report]' ;; \
      *) echo "SUITE is '${SUITE}'; it has to be full or smoke" >&2; exit 2 ;; \
    esac \
 && echo 'path-include /usr/share/doc/opencv-doc/examples/data/aloe*' > /etc/dpkg/dpkg.cfg.d/zz-stereo-pair \
 && apt-get update \
 && awk -v sections="${sections}" \
      '{ sub(/#.*/, "") } /^\[/ { wanted = index(sections, $1); next } wanted && NF { print $1 }' /tmp/packages.apt \
    | DEBIAN_FRONTEND=noninteractive xargs apt-get install -y --no-install-recommends \
 && rm -rf /var/lib/apt/lists/* /tmp/packages.apt \
 && install -d /usr/share/beyond-photometric \
 && dpkg-query -W -f '${Package} ${Version} ${Architecture}\n' > /usr/share/beyond-photometric/packages.txt \
 && useradd --create-home --uid 1000 sgf \
 && install -d -o sgf -g sgf /opt/beyond-photometric

USER sgf
WORKDIR /opt/beyond-photometric
COPY --chown=sgf:sgf . .

# Any user id may run the image (--user): everything is writable to all, the home is /tmp, and the files whose mode
# CMake sets, which only their owner may do, are left for the run to make anew.
ENV HOME=/tmp USER=sgf
ARG REVISION
LABEL org.opencontainers.image.revision="${REVISION:-unknown}"
RUN echo "${REVISION:-unknown}" > REVISION \
 && case "${SUITE}" in \
      full) cmake --preset release && cmake --build --preset release ;; \
      smoke) ./reproduce.sh --only table1 && cat results/tables/table1.csv \
          && find results -mindepth 1 -maxdepth 1 ! -name reference -exec rm -rf {} + ;; \
    esac \
 && find build/release -regex '.*/\(provenance.cc\|.*-config.*\.cmake\|CPack.*Config\.cmake\)' -delete \
 && mkdir -p results datasets/generated datasets/downloaded \
 && chmod -R a+rwX .

ENTRYPOINT ["./reproduce.sh"]
