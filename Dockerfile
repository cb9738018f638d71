# tribodyn with all extras of pyproject.toml.   docker build -t tribodyn .
# docker run --rm -v "$PWD:/work" tribodyn run beam
FROM python:3.13-slim
RUN apt-get update \
    && apt-get install -y --no-install-recommends libglu1-mesa libgl1 libegl1 libxcursor1 libxft2 libxinerama1 libgomp1 \
    && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN pip install --no-cache-dir "/source[all]" && rm -rf /source
WORKDIR /work
ENTRYPOINT ["tribodyn"]
