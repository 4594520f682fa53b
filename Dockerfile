# The simulator and the pipeline, with the exact packages of requirements.lock:
#   docker build -t radarize .
#   docker run --rm -v "$PWD:/data" radarize radarsim simulate office -o walk.h5 --duration 20
# A radar needs the host's network and its serial port:
#   docker run --rm -v "$PWD:/data" --network host --device /dev/ttyACM0 radarize \
#     radarize capture --config radarize --port /dev/ttyACM0 -o walk.h5
FROM python:3.11-slim-bookworm
# LLVM for the ray tests; shared libraries of open3d.
RUN apt-get update \
    && apt-get install -y --no-install-recommends libllvm19 libusb-1.0-0 libudev1 libegl1 libgl1 libx11-6 libidn2-0 libgomp1 \
    && rm -rf /var/lib/apt/lists/*
COPY requirements.lock /source/
RUN pip install --no-cache-dir --no-deps "$(grep '^torch==' /source/requirements.lock)" \
        --index-url https://download.pytorch.org/whl/cpu \
    && pip install --no-cache-dir --no-deps -r /source/requirements.lock
COPY . /source
# The first frame compiles the simulator's kernels, which stay in the image.
RUN pip install --no-cache-dir --no-deps --no-build-isolation /source \
    && cd / && python -m radarsim.doctor --first-frame
WORKDIR /data
CMD ["radarsim", "doctor"]
