!> How ranks would share the points of a scene, for `check --ranks N`.
module pd_output_report_ranks
  use pd_base_kinds, only: wp, i8
  use pd_base_text, only: line => labelled_line, to_text, with_unit
  use pd_body_body, only: body_type, gather
  use pd_body_division, only: box_of, divide_space, division_type, owner_of, work_of_points
  use pd_body_work, only: work_rule_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_volume, only: reach
  use pd_scene_content_types, only: scene_type
  use pd_set_up_ranks, only: bounds_of_bodies, rule_of_work, work_of_body
  implicit none (type, external)
  private
  public :: table_of_ranks

  integer, parameter :: most_lines = 32   !! ranks that are listed

  !> What a rank would have.
  type :: share_type
    integer(i8) :: points = 0_i8
    integer(i8) :: bonds = 0_i8           !! ordered pairs
    integer(i8) :: halo = 0_i8            !! copies of other ranks' points
  end type share_type

contains

  !> The tree of cuts with the points, bonds and halo of each rank, and how well they are balanced:
  !> the largest over the mean of the work by which space is cut, of bonds and of points.
  function table_of_ranks(scene, body, family, ranks) result(text)
    type(scene_type), intent(in) :: scene      !! the scene of the body
    type(body_type), intent(in) :: body        !! with all points, arranged in slots
    class(family_type), intent(in) :: family   !! of the body
    integer, intent(in) :: ranks               !! how many there would be
    character(:), allocatable :: text
    type(work_of_points) :: work
    type(division_type) :: division
    type(share_type), allocatable :: shares(:)
    type(work_rule_type) :: rule
    real(wp), dimension(3, size(scene%bodies)) :: lower, upper

    call bounds_of_bodies(body, lower, upper)
    call rule_of_work(scene, body%delta, body%largest_spacing, lower, upper, rule)
    call work_of_body(body, 1, work, rule)
    call divide_space(work, ranks, division)
    call find_shares(body, family, division, shares)
    text = line('ranks', to_text(ranks)//': the largest has '// &
      & over_mean(division%work)//' times the mean of the predicted work, '// &
      & over_mean(real(shares%bonds, wp))//' times that of bonds, '// &
      & over_mean(real(shares%points, wp))//' times that of points')
    text = text//line('', 'halos are '//to_text(100*real(sum(shares%halo), wp) &
      & /max(1_i8, sum(shares%points)), 3)//' % of the points')
    if (ranks <= most_lines) call add_part(division, 1, shares, 1, text)
  end function table_of_ranks

  !> The largest of some numbers over their mean.
  pure function over_mean(values) result(text)
    real(wp), intent(in) :: values(:)
    character(:), allocatable :: text
    text = to_text(maxval(values)*size(values)/max(sum(values), tiny(1.0_wp)), 4)
  end function over_mean

  !> Points, bonds and halos of all ranks.
  subroutine find_shares(body, family, division, shares)
    type(body_type), intent(in) :: body
    class(family_type), intent(in) :: family
    type(division_type), intent(in) :: division
    type(share_type), allocatable, intent(out) :: shares(:)
    type(bonds_type) :: bonds
    real(wp) :: x(body%dim), farthest
    integer :: i, k, r, owner
    integer, allocatable :: number(:)

    allocate (shares(0:division%ranks - 1))
    allocate (number(body%n_slots), source=-1)
    call allocate_bonds(family, bonds)
    farthest = 0.0_wp
    do i = 1, body%n_points
      farthest = max(farthest, reach(family%rule, body%spacing(body%slot(i)), body%dim))
    end do
    do i = 1, body%n_points
      k = family%alike(int(body%slot(i)))
      if (number(k) < 0) then
        call family%bonds_of(k, bonds)
        number(k) = bonds%n
      end if
      x = body%x(body%slot(i), :)
      owner = owner_of(division, x)
      shares(owner)%points = shares(owner)%points + 1_i8
      shares(owner)%bonds = shares(owner)%bonds + number(k)
    end do
    !$omp parallel do schedule(dynamic) default(none) shared(body, division, shares, farthest) &
    !$omp private(r, i, x)
    do r = 0, division%ranks - 1
      associate (box => box_of(division, r))
        do i = 1, body%n_points
          x = body%x(body%slot(i), :)
          if (all(x >= box(:, 1) - farthest .and. x <= box(:, 2) + farthest)) &
            & shares(r)%halo = shares(r)%halo + 1_i8
        end do
      end associate
      shares(r)%halo = shares(r)%halo - shares(r)%points
    end do
  end subroutine find_shares

  !> Add a part and what it is cut into, a line each.
  recursive subroutine add_part(division, part, shares, depth, text)
    type(division_type), intent(in) :: division
    integer, intent(in) :: part, depth
    type(share_type), intent(in) :: shares(0:)
    character(:), allocatable, intent(inout) :: text
    character(:), allocatable :: indent
    integer :: r

    r = division%first_rank(part)
    indent = repeat('  ', depth - 1)
    if (division%axis(part) == 0) then
      text = text//line('', indent//'rank '//to_text(r)//': '// &
        & to_text(shares(r)%points)//' points, '//to_text(shares(r)%bonds)//' bonds, halo '// &
        & to_text(shares(r)%halo))
      return
    end if
    text = text//line('', indent//'ranks '//to_text(r)//' to '// &
      & to_text(r + division%n_ranks(part) - 1)//': cut across '// &
      & 'xyz'(division%axis(part):division%axis(part))//' at '//with_unit(division%at(part), 'm'))
    call add_part(division, division%half(part), shares, depth + 1, text)
    call add_part(division, division%half(part) + 1, shares, depth + 1, text)
  end subroutine add_part

end module pd_output_report_ranks
