function answer = frictus_http(host, port, token, method, path, body)
  % FRICTUS_HTTP  Ask REST at a service; body is JSON text. See docs/rest.md.
  link = frictus_socket.open(host, port);
  lines = sprintf('%s %s HTTP/1.1\r\nHost: %s:%d\r\nConnection: close\r\n', method, path, ...
    host, port);
  if ~isempty(token)
    lines = [lines sprintf('Authorization: Bearer %s\r\n', token)];
  end
  if ~isempty(body)
    lines = [lines sprintf('Content-Type: application/json\r\nContent-Length: %d\r\n', ...
      numel(uint8(body)))];
    if any(strcmp(method, {'PUT', 'DELETE'}))
      lines = [lines sprintf('If-Match: *\r\n')];
    end
  end
  write(link, uint8([lines sprintf('\r\n') body]));
  text = http_answer(link, 10);
  clear link
  [head, content] = halves(text);
  answer = [];
  if ~isempty(content)
    answer = jsondecode(content);
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

function text = http_answer(link, within_s)
  % Everything until the service closes, or its Content-Length has come.
  began = tic();
  text = '';
  while toc(began) < within_s
    bytes = frictus_socket.available(link);
    if ~isempty(bytes)
      text = [text, char(bytes)];
      [head, content] = halves(text);
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

function [head, content] = halves(text)
  at = strfind(text, sprintf('\r\n\r\n'));
  head = '';
  content = '';
  if ~isempty(at)
    head = text(1:at(1));
    content = text(at(1) + 4:end);
  end
end
