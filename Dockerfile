# Two stages: the first installs the lock file and compiles the kernels, the second carries the result and nothing else.
# BASE: any image with Python 3.11 to 3.13 and its venv module, glibc.
ARG BASE=python:3.11-slim-bookworm

FROM ${BASE} AS builder
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PIP_ROOT_USER_ACTION=ignore
RUN python3 -m venv /opt/airside
WORKDIR /srv/airside
COPY requirements.lock ./
RUN /opt/airside/bin/pip install --quiet --require-hashes -r requirements.lock
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY pipeline ./pipeline
COPY app ./app
COPY migrations ./migrations
COPY static ./static
RUN /opt/airside/bin/pip install --quiet --no-deps --no-build-isolation --editable . \
 && /opt/airside/bin/python -m compileall -q app pipeline
# kernels: compiled for the processor that builds the image; on another kind they are compiled once at the first start
ENV NUMBA_CACHE_DIR=/opt/airside-kernels
RUN AIRSIDE_DATA_DIR=/tmp/airside /opt/airside/bin/airside warmup && rm -rf /tmp/airside

FROM ${BASE}
RUN useradd --system --uid 10001 --home-dir /data --shell /usr/sbin/nologin airside \
 && mkdir -p /data /settings /var/cache/airside && chown airside:airside /data /var/cache/airside && chmod 700 /data
COPY --from=builder /opt/airside /opt/airside
COPY --from=builder /srv/airside /srv/airside
# not where volumes are mounted: one of an older image would hide them; a start copies them to NUMBA_CACHE_DIR
COPY --from=builder /opt/airside-kernels /opt/airside-kernels
ENV PATH=/opt/airside/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CACHE_DIR=/var/cache/airside \
    AIRSIDE_SHIPPED_KERNELS=/opt/airside-kernels \
    AIRSIDE_HOST=0.0.0.0 \
    AIRSIDE_PORT=8000 \
    AIRSIDE_UDP_ADDRESS=0.0.0.0 \
    AIRSIDE_DATA_DIR=/data
# a path in AIRSIDE_AIRPORT or --settings counts from where the settings are mounted
WORKDIR /settings
USER airside
VOLUME /data
# HTTP, and radar video as CAT240; the port is AIRSIDE_PORT, which goes over the settings file: the health check asks there
EXPOSE 8000/tcp 8600/udp
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
  CMD ["python", "-c", "import os, urllib.request as u; u.urlopen('http://127.0.0.1:' + os.environ['AIRSIDE_PORT'] + '/health/ready', timeout=4)"]
STOPSIGNAL SIGTERM
ENTRYPOINT ["airside"]
CMD ["demo"]
