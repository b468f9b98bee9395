# docker build -t phonotaxis . && docker run --rm phonotaxis
# Results: docker run --rm -v "$PWD/results:/phonotaxis/results" phonotaxis
FROM python:3.12-slim-bookworm

# libglib2.0-0: Drake needs it; make: for the targets of the Makefile.
# hadolint ignore=DL3008
RUN apt-get update && \
    apt-get install -y --no-install-recommends libglib2.0-0 make && \
    rm -rf /var/lib/apt/lists/*

WORKDIR /phonotaxis
COPY . .
RUN make .venv/.installed

ENV PATH="/phonotaxis/.venv/bin:$PATH"
CMD ["make", "demo"]
