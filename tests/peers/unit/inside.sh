#!/bin/bash
# Runs inside the virtual machine, as a unit of its own once the machine is up. Each line it prints is `figure NAME VALUE`; unit.py judges them.
set -u
figure() { echo "figure $*"; }
main_pid() { systemctl show -p MainPID --value platen@p1; }
now() { cut -d' ' -f1 /proc/uptime; }
since() { awk -v a="$1" -v b="$(now)" 'BEGIN { printf "%.2f", b - a }'; }

# Waits until the host is READY under another process number than the one given. State and number are asked for at once: between two questions a host
# that was active can have died, and no number is none of another host.
ready_again() {
  for _ in $(seq 1200); do
    case "$(systemctl show -p ActiveState -p MainPID platen@p1 | sort | tr '\n' ' ')" in
      "ActiveState=active MainPID=0 " | "ActiveState=active MainPID=$1 ") ;;
      "ActiveState=active "*) return 0 ;;
    esac
    sleep 0.05
  done
  return 1
}

# A member of the state that a host writes.
state() { platen status "/etc/platen/$1.toml" --json | sed -n "s/^ *\"$2\": \(.*[^,]\),\{0,1\}$/\1/p" | head -1; }

figure systemd "$(systemctl --version | head -1 | cut -d' ' -f2)"
figure debian "$(cat /etc/debian_version)"

systemctl start platen-sim-press
began=$(now)
systemctl start platen@p1
figure start_exit $?
figure ready_s "$(since "$began")"

# Strokes are measured: the kernel of this release lets a confined plugin work. What the host says of those that are not stands in the output.
for _ in $(seq 240); do [ "$(state p1 measured)" != 0 ] && break; sleep 1; done
figure measured "$(state p1 measured)"
figure not_measured "$(state p1 not_measured)"
journalctl -o short-monotonic --no-pager -u platen@p1 -t platen

# Every flattening works on this processor, confined.
platen scan /etc/platen/p1.toml /root/plate.e57 >/dev/null
for plugin in harmonic abf elastic; do
  platen measure --plant /etc/platen/p1.toml --plate /usr/share/doc/platen/config/plates/plate-009.toml --flattening $plugin /root/plate.e57 >/dev/null
  figure "$plugin" $?
done

pid=$(main_pid); began=$(now)
kill -9 "$pid"
ready_again "$pid" && figure ready_after_kill_s "$(since "$began")"

pid=$(main_pid); began=$(now)
kill -STOP "$pid"
ready_again "$pid" && figure ready_after_stop_s "$(since "$began")"
figure watchdog_lines "$(journalctl -u platen@p1 | grep -c 'Watchdog timeout')"

# A press that is off is no reason to restart its host: the cycle goes on asking for it.
pid=$(main_pid)
systemctl stop platen-sim-press
sleep 15
figure same_host_without_press $([ "$(main_pid)" = "$pid" ] && echo yes || echo no)
journalctl -o short-monotonic --no-pager -u platen@p1 _COMM=systemd
systemctl start platen-sim-press

# A newer package is laid over the running host.
dpkg -i /root/platen_*.deb >/dev/null 2>&1
figure same_host_after_upgrade $([ "$(main_pid)" = "$pid" ] && echo yes || echo no)

# A plant file that is wrong.
systemctl start platen@bad
figure bad_start_exit $?
sleep 4
figure bad_state "$(systemctl show -p ActiveState --value platen@bad)"
figure bad_lines "$(journalctl -o cat -t platen -u platen@bad | grep -c 'bad.toml')"
figure bad_says "$(journalctl -o cat -t platen -u platen@bad | grep -m1 'bad.toml')"

# A host is stopped while a stroke is measured. On this processor the stop may take longer than the watchdog's period.
for _ in $(seq 1200); do [ "$(state p1 state)" = '"evaluating"' ] && break; sleep 0.05; done
began=$(now)
systemctl stop platen@p1
figure stop_s "$(since "$began")"
figure stop_result "$(systemctl show -p Result --value platen@p1)"
journalctl -o short-monotonic --no-pager -u platen@p1 -n 12

# A press at an address that only the drop-in allows. The plant is the same but for the address.
ip address add 10.9.8.7/32 dev lo
sed 's/host = "127.0.0.1"/host = "10.9.8.7"/; s/p1/p2/' /etc/platen/p1.toml > /etc/platen/p2.toml
systemctl start platen@p2
sleep 8
figure state_without_drop_in "$(state p2 state)"
systemctl stop platen@p2
mkdir -p /etc/systemd/system/platen@p2.service.d
platen systemd /etc/platen/p2.toml > /etc/systemd/system/platen@p2.service.d/plant.conf
systemctl daemon-reload
systemctl start platen@p2
sleep 8
figure state_with_drop_in "$(state p2 state)"

figure exposure "$(systemd-analyze security --no-pager platen@p2.service | sed -n 's/.*exposure level for [^:]*: \([0-9.]*\).*/\1/p')"
figure owner "$(stat -c %U:%a /var/lib/platen/p1)"

# Removing the package ends the hosts; purging leaves the record.
dpkg --purge platen-sim platen >/dev/null 2>&1
figure purge_exit $?
figure active_after_purge "$(systemctl is-active platen@p2)"
figure record_after_purge "$(find /var/lib/platen -name '*.sqlite' | wc -l)"
figure done yes
systemctl poweroff
