# `docker build -t imuarray:1.0.0 .`; the workflow names it (docs/pipeline.md).
FROM python:3.12.12-slim-bookworm

WORKDIR /opt/imuarray
COPY requirements.lock ./
RUN pip install --no-cache-dir --require-hashes -r requirements.lock
COPY . .
RUN pip install --no-cache-dir --no-deps --no-build-isolation .

WORKDIR /work
CMD ["imuarray", "--help"]
