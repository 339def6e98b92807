function answer = frictus_http(host, port, token, method, path, body)
  % FRICTUS_HTTP  Ask REST at a service; body is JSON text. See docs/rest.md.
  link = frictus_socket.open(host, port);
  lines = sprintf('%s %s HTTP/1.1\r\nHost: %s:%d\r\nConnection: close\r\n', method, path, ...
    host, port);
  if ~isempty(token)
    lines = [lines sprintf('Authorization: Bearer %s\r\n', token)];
  end
  body = frictus_socket.utf8(body);
  if ~isempty(body)
    lines = [lines sprintf('Content-Type: application/json\r\nContent-Length: %d\r\n', ...
      numel(body))];
    if any(strcmp(method, {'PUT', 'DELETE'}))
      lines = [lines sprintf('If-Match: *\r\n')];
    end
  end
  write(link, [uint8([lines sprintf('\r\n')]), body]);
  answered = http_answer(link, 10);
  clear link
  [head, content] = halves(answered);
  answer = [];
  if ~isempty(content)
    answer = jsondecode(frictus_socket.text(content));
  end
  status = sscanf(head, 'HTTP/1.1 %d');
  if isempty(status) || status >= 400
    code = 'no_answer';
    detail = head;
    if isfield(answer, 'code')
      code = answer.code;
      detail = answer.detail;
    end
    error(['frictus:' code], '%s %s: %s', method, path, detail);
  end
end

function answered = http_answer(link, within_s)
  % All bytes until the service closes, or its Content-Length has come.
  began = tic();
  answered = zeros(1, 0, 'uint8');
  while toc(began) < within_s
    bytes = frictus_socket.available(link);
    if ~isempty(bytes)
      answered = [answered, bytes];
      [head, content] = halves(answered);
      wanted = regexp(head, 'content-length: *(\d+)', 'tokens', 'once', 'ignorecase');
      whole = ~isempty(head) && (~isempty(strfind(head, ' 204 ')) || ...
        (~isempty(wanted) && numel(content) >= str2double(wanted{1})));
      if whole
        return
      end
    else
      pause(0.005);
    end
  end
end

function [head, content] = halves(answered)
  at = strfind(char(answered), sprintf('\r\n\r\n'));
  head = '';
  content = zeros(1, 0, 'uint8');
  if ~isempty(at)
    head = char(answered(1:at(1)));
    content = answered(at(1) + 4:end);
  end
end
