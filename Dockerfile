# hatlab in a container: CPU torch, no root, one port. Build: docker build -t hatlab .
FROM python:3.11-slim-bookworm AS build
# The index that holds PyTorch's CPU wheels; empty: pip's default, which brings CUDA.
ARG TORCH_INDEX=https://download.pytorch.org/whl/cpu
WORKDIR /app
COPY pyproject.toml constraints.txt README.md LICENSE ./
RUN python -m venv /venv \
 && /venv/bin/pip install --no-cache-dir --no-deps ${TORCH_INDEX:+--index-url "$TORCH_INDEX"} "torch==$(sed -n 's/^torch==//p' constraints.txt)"
COPY models models
COPY server server
COPY migrations migrations
COPY static static
COPY templates templates
COPY alembic.ini ./
RUN /venv/bin/pip install --no-cache-dir --constraint constraints.txt --editable '.[mturk]'

FROM python:3.11-slim-bookworm
RUN useradd --create-home --uid 10001 hatlab && mkdir -p /app/var && chown hatlab /app/var
COPY --from=build /venv /venv
COPY --from=build /app /app
WORKDIR /app
USER 10001
ENV PATH=/venv/bin:$PATH PYTHONUNBUFFERED=1
EXPOSE 8000
VOLUME /app/var
HEALTHCHECK --interval=30s --timeout=5s --start-period=20s \
  CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/healthz', timeout=4)"]
CMD ["sh", "-c", "hatlab init && exec hatlab serve --host 0.0.0.0 --port 8000 --workers ${HATLAB_WORKERS:-2}"]
