"""nginx in front of several APIs, with the settings of `docs/deploy.md`, as its own process."""

import contextlib
import shutil
import subprocess
import tempfile
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from frictus_service.processes import free_port

START_S: Final = 10.0
CONFIGURATION: Final = """\
daemon off;
worker_processes 1;
pid {folder}/nginx.pid;
error_log stderr error;
events {{ worker_connections 4096; }}
http {{
    access_log off;
    client_body_temp_path {folder}/bodies;
    proxy_temp_path {folder}/answers;
    fastcgi_temp_path {folder}/unused;
    uwsgi_temp_path {folder}/unused;
    scgi_temp_path {folder}/unused;
    upstream apis {{ {servers} }}
    server {{
        listen 127.0.0.1:{port};
        client_header_timeout 10s;
        client_body_timeout 10s;
        client_max_body_size 10m;
        location / {{
            proxy_pass http://apis;
            proxy_http_version 1.1;
            proxy_set_header Host 127.0.0.1;
            proxy_set_header Origin "";
            proxy_set_header X-Forwarded-For $remote_addr;
            proxy_set_header Upgrade $http_upgrade;
            proxy_set_header Connection $http_connection;
            proxy_buffering off;
            proxy_read_timeout 1h;
        }}
    }}
}}
"""


@contextlib.contextmanager
def balancing(ports: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Run nginx until the context ends; give its port and its process id.

    Parameters
    ----------
    ports : sequence of int
        Of the APIs of this machine, which requests go to in turns.

    Raises
    ------
    OSError
        If nginx is not installed, or does not start.
    """
    command = shutil.which("nginx")
    if command is None:
        raise OSError("nginx is not on the PATH: sudo apt-get install nginx-light")
    port = free_port()
    with tempfile.TemporaryDirectory(prefix="frictus-nginx-") as folder:
        servers = " ".join(f"server 127.0.0.1:{api};" for api in ports)
        Path(folder).chmod(0o711)  # the worker is somebody else where nginx is started by root
        settings = Path(folder) / "nginx.conf"
        settings.write_text(CONFIGURATION.format(folder=folder, servers=servers, port=port))
        with subprocess.Popen([command, "-c", str(settings)]) as process:
            try:
                _await_answer(port, process)
                yield port, process.pid
            finally:
                process.terminate()


def _await_answer(port: int, process: "subprocess.Popen[bytes]") -> None:
    until_s, pause = time.monotonic() + START_S, threading.Event()  # never set
    while process.poll() is None and time.monotonic() < until_s:
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/v1/health", timeout=5.0).close()
            return
        except urllib.error.HTTPError as error:
            error.close()
            return  # it is there, whoever is behind it
        except OSError:
            pause.wait(0.05)
    raise OSError(f"nginx does not answer at port {port}, exit code {process.poll()}")
