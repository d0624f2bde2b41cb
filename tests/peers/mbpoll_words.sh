#!/bin/sh
# Reads holding registers with mbpoll, a client on libmodbus, and prints the raw words as a JSON list.
#
#     apt-get install mbpoll
#     ./mbpoll_words.sh 127.0.0.1:1502 100 64          over TCP, unit 1: host and port, first address, count
#     ./mbpoll_words.sh /dev/pts/7@115200 100 64       RTU, even parity: device and speed
set -eu
[ $# -eq 3 ] || { echo "usage: $0 HOST:PORT|DEVICE@BAUD ADDRESS COUNT" >&2; exit 2; }
case $1 in
*@*) link="-m rtu -b ${1#*@} -P even ${1%@*}" ;;
*) link="-m tcp -p ${1##*:} ${1%:*}" ;;
esac
# shellcheck disable=SC2086  # the link is several words on purpose
out=$(mbpoll -0 -1 -q -a 1 -t 4:hex -r "$2" -c "$3" $link 2>&1) || { echo "$out" >&2; exit 1; }
echo "$out" | awk -v want="$3" '
    /^\[[0-9]+\]:/ { words[n++] = strtonum_hex($2) }
    function strtonum_hex(text,   i, value) {
        value = 0
        for (i = 3; i <= length(text); i++) value = value * 16 + index("0123456789abcdef", tolower(substr(text, i, 1))) - 1
        return value
    }
    END {
        if (n != want) { print "mbpoll gave " n + 0 " words, wanted " want > "/dev/stderr"; exit 1 }
        printf "["
        for (i = 0; i < n; i++) printf "%s%d", i ? ", " : "", words[i]
        print "]"
    }'
